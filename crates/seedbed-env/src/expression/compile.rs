//! Compiles the text of a formula to a program: parses it (with `syn`, a parser of Rust syntax),
//! checks it, computes constant parts, and lists the remaining operations as instructions.

use proc_macro2::Span;
use syn::{BinOp, Block, Expr, ExprBinary, ExprCall, ExprIf, ExprLit, ExprUnary, Lit, Stmt, UnOp};

use super::delimiters::tokenization_error;
use super::error::ExpressionError;
use super::operation::{FUNCTIONS, Operation};
use super::{Instruction, Operand, Program, Type};
use seedbed_input::limits::MAX_FORMULA_BYTES;
use seedbed_input::quoted_list;

/// A name that a formula may use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// Name in formulas.
    pub name: String,
    /// Column of its current value.
    pub column: usize,
    /// Where `previous(name)` reads its value before the step.
    pub previous: Previous,
}

/// The value of a name before the step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Previous {
    /// It is in this column.
    Column(usize),
    /// Only other formulas can read it: those of rewards and ends of episodes.
    NotHere,
    /// There is none: it is an action, or a number that is drawn.
    Nowhere,
}

/// Names that are reserved in formulas.
pub const RESERVED_NAMES: [&str; 3] = ["pi", "degree", "previous"];

/// Compiles a formula of the given type over `variables`.
///
/// # Errors
/// The text is not a formula, reads an unknown name, or has another type.
pub fn compile(
    text: &str,
    expected: Type,
    variables: &[Variable],
) -> Result<Program, ExpressionError> {
    if text.len() > MAX_FORMULA_BYTES {
        let message = format!(
            "a formula can have at most {MAX_FORMULA_BYTES} characters, this one has {}",
            text.len()
        );
        return Err(ExpressionError {
            message,
            help: None,
            line: 0,
            column: 0,
        });
    }
    let expression = syn::parse_str::<Expr>(text).map_err(|error| syntax_error(text, &error))?;
    let mut compiler = Compiler {
        variables,
        constants: Vec::new(),
        instructions: Vec::new(),
    };
    let result = compiler.compile_as(&expression, expected)?;
    Ok(compiler.finish(result))
}

struct Compiler<'a> {
    variables: &'a [Variable],
    constants: Vec<f32>,
    instructions: Vec<(Operation, Vec<Value>)>,
}

/// The value of a part of a formula.
#[derive(Clone, Copy)]
enum Value {
    Constant(f32),
    Variable(usize),
    /// The result of the instruction with this index.
    Result(usize),
}

/// Value and type of a part of a formula, or its error.
type TypedValueResult = Result<(Value, Type), ExpressionError>;

impl Compiler<'_> {
    /// The part's value, if its type is the expected one.
    fn compile_as(&mut self, expression: &Expr, expected: Type) -> Result<Value, ExpressionError> {
        match self.compile_part(expression)? {
            (value, found) if found == expected => Ok(value),
            (_, found) => {
                let error = error(
                    start_of(expression),
                    format!("expected {}, found {}", expected.name(), found.name()),
                );
                Err(if expected == Type::Number {
                    error.with_help(
                        "write `if … { 1 } else { 0 }` to turn a condition into a number",
                    )
                } else {
                    error
                })
            }
        }
    }

    /// Compiles a part of a formula.
    fn compile_part(&mut self, expression: &Expr) -> TypedValueResult {
        match expression {
            Expr::Lit(literal) => literal_value(literal),
            Expr::Paren(inner) => self.compile_part(&inner.expr),
            Expr::Path(path) => match path.path.get_ident() {
                Some(name) => self.name(&name.to_string(), name.span()),
                None => Err(not_a_formula(expression)),
            },
            Expr::Unary(unary) => self.unary(unary, expression),
            Expr::Binary(binary) => self.binary(binary, expression),
            Expr::Call(call) => self.call(call),
            Expr::If(choice) => self.choice(choice),
            Expr::Block(block) => self.block(&block.block),
            other => Err(not_a_formula(other)),
        }
    }

    fn name(&mut self, name: &str, span: Span) -> TypedValueResult {
        match name {
            "pi" => Ok((Value::Constant(std::f32::consts::PI), Type::Number)),
            "degree" => Ok((Value::Constant(std::f32::consts::PI / 180.0), Type::Number)),
            _ => match self.variables.iter().find(|variable| variable.name == name) {
                Some(variable) => Ok((Value::Variable(variable.column), Type::Number)),
                None => Err(self.unknown_name(name, span)),
            },
        }
    }

    fn unary(&mut self, unary: &ExprUnary, whole: &Expr) -> TypedValueResult {
        match &unary.op {
            UnOp::Neg(_) => self.apply(Operation::Negate, &[&unary.expr]),
            UnOp::Not(_) => self.apply(Operation::Not, &[&unary.expr]),
            UnOp::Deref(token) => Err(error(token.span, NOT_A_FORMULA).with_help(POWER_HELP)),
            _ => Err(not_a_formula(whole)),
        }
    }

    fn binary(&mut self, binary: &ExprBinary, whole: &Expr) -> TypedValueResult {
        let (left, right) = (&*binary.left, &*binary.right);
        match &binary.op {
            BinOp::Add(_) => self.apply(Operation::Add, &[left, right]),
            BinOp::Sub(_) => self.apply(Operation::Subtract, &[left, right]),
            BinOp::Mul(_) => self.apply(Operation::Multiply, &[left, right]),
            BinOp::Div(_) => self.apply(Operation::Divide, &[left, right]),
            BinOp::Rem(_) => self.apply(Operation::Remainder, &[left, right]),
            BinOp::Lt(_) => self.apply(Operation::Less, &[left, right]),
            BinOp::Le(_) => self.apply(Operation::LessOrEqual, &[left, right]),
            BinOp::Gt(_) => self.apply(Operation::Less, &[right, left]),
            BinOp::Ge(_) => self.apply(Operation::LessOrEqual, &[right, left]),
            BinOp::Eq(_) => self.apply(Operation::Equal, &[left, right]),
            BinOp::Ne(_) => self.apply(Operation::NotEqual, &[left, right]),
            BinOp::And(_) => self.apply(Operation::And, &[left, right]),
            BinOp::Or(_) => self.apply(Operation::Or, &[left, right]),
            BinOp::BitXor(token) => {
                Err(error(token.span, "`^` is not an operator of formulas").with_help(POWER_HELP))
            }
            _ => Err(not_a_formula(whole)),
        }
    }

    fn call(&mut self, call: &ExprCall) -> TypedValueResult {
        let Expr::Path(path) = &*call.func else {
            return Err(not_a_formula(&call.func));
        };
        let Some(function) = path.path.get_ident() else {
            return Err(not_a_formula(&call.func));
        };
        let (name, arguments) = (function.to_string(), call.args.iter().collect::<Vec<_>>());
        let parameters = match Operation::named(&name) {
            Some(operation) => operation.argument_count(),
            None if name == "previous" => 1,
            None => return Err(unknown_function(&name, function.span())),
        };
        if arguments.len() != parameters {
            let plural = if parameters == 1 { "" } else { "s" };
            let message = format!(
                "`{name}` takes {parameters} argument{plural}, found {}",
                arguments.len()
            );
            return Err(error(function.span(), message));
        }
        match Operation::named(&name) {
            Some(operation) => self.apply(operation, &arguments),
            None => self.previous(arguments[0]),
        }
    }

    fn previous(&mut self, argument: &Expr) -> TypedValueResult {
        let name = match argument {
            Expr::Path(path) => path.path.get_ident(),
            _ => None,
        };
        let Some(name) = name else {
            return Err(error(
                start_of(argument),
                "`previous` takes the name of an observation or a sensor",
            ));
        };
        let Some(variable) = self
            .variables
            .iter()
            .find(|variable| name == &variable.name)
        else {
            return Err(self.unknown_name(&name.to_string(), name.span()));
        };
        let message = match variable.previous {
            Previous::Column(column) => return Ok((Value::Variable(column), Type::Number)),
            Previous::NotHere => {
                "is not available here: only `reward` and `terminated` can read the values of \
                 observations and sensors before the step"
            }
            Previous::Nowhere => {
                "does not exist: only observations and sensors have a value before the step"
            }
        };
        let text = format!("`previous({name})` {message}");
        Err(error(name.span(), text))
    }

    /// Both branches are computed and one result is taken, which is possible because formulas have
    /// no side effects.
    fn choice(&mut self, choice: &ExprIf) -> TypedValueResult {
        let condition = self.compile_as(&choice.cond, Type::Boolean)?;
        let Some((_, otherwise)) = &choice.else_branch else {
            return Err(error(choice.if_token.span, "`if` needs an `else { … }`"));
        };
        let (first, kind) = self.block(&choice.then_branch)?;
        let second = self.compile_as(otherwise, kind)?;
        let operation = match kind {
            Type::Number => Operation::ChooseNumber,
            Type::Boolean => Operation::ChooseBoolean,
        };
        Ok((self.emit(operation, vec![condition, first, second]), kind))
    }

    fn block(&mut self, block: &Block) -> TypedValueResult {
        match &block.stmts[..] {
            [Stmt::Expr(expression, None)] => self.compile_part(expression),
            _ => Err(error(
                block.brace_token.span.open(),
                "expected a single expression between the braces",
            )),
        }
    }

    fn apply(&mut self, operation: Operation, arguments: &[&Expr]) -> TypedValueResult {
        let parameters = operation.parameters().iter();
        let values = arguments
            .iter()
            .zip(parameters)
            .map(|(argument, &kind)| self.compile_as(argument, kind));
        let values = values.collect::<Result<Vec<_>, _>>()?;
        check_constants(operation, &values, arguments)?;
        let value = self.emit(operation, values);
        if let Value::Constant(constant) = value
            && !constant.is_finite()
        {
            return Err(error(
                start_of(arguments[0]),
                format!(
                    "{} is {constant} here: expected a finite number",
                    operation.description()
                ),
            ));
        }
        Ok((value, operation.result()))
    }

    /// The operation's value: computed here if all operands are constant, else by an instruction.
    /// The same function computes both, so that the bits are the same.
    fn emit(&mut self, operation: Operation, operands: Vec<Value>) -> Value {
        let constant = |value: &Value| {
            if let Value::Constant(constant) = value {
                Some(*constant)
            } else {
                None
            }
        };
        if let Some(constants) = operands.iter().map(constant).collect::<Option<Vec<_>>>() {
            let operand = |index| constants.get(index).copied().unwrap_or_default();
            return Value::Constant(operation.value(operand(0), operand(1), operand(2)));
        }
        self.instructions.push((operation, operands));
        Value::Result(self.instructions.len() - 1)
    }

    /// Assigns the scratch columns: constants first, then one per instruction.
    fn finish(mut self, result: Value) -> Program {
        let operands = self
            .instructions
            .iter()
            .flat_map(|(_, operands)| operands)
            .chain([&result]);
        for operand in operands {
            if let Value::Constant(constant) = operand
                && !self
                    .constants
                    .iter()
                    .any(|known| known.to_bits() == constant.to_bits())
            {
                self.constants.push(*constant);
            }
        }
        let column_of = |value: &Value| match *value {
            Value::Variable(column) => Operand::Variable(column),
            Value::Result(index) => Operand::Scratch(self.constants.len() + index),
            Value::Constant(constant) => Operand::Scratch(
                self.constants
                    .iter()
                    .take_while(|known| known.to_bits() != constant.to_bits())
                    .count(),
            ),
        };
        let instruction = |(operation, operands): &(Operation, Vec<Value>)| Instruction {
            operation: *operation,
            operands: std::array::from_fn(|index| {
                column_of(operands.get(index).unwrap_or(&operands[0]))
            }),
        };
        let instructions = self.instructions.iter().map(instruction).collect();
        Program {
            instructions,
            result: column_of(&result),
            constants: self.constants,
        }
    }

    fn unknown_name(&self, name: &str, span: Span) -> ExpressionError {
        let valid = || {
            self.variables
                .iter()
                .map(|variable| variable.name.as_str())
                .chain(["pi", "degree"])
        };
        let unknown = error(
            span,
            format!(
                "no variable is named `{name}`, expected one of {}",
                quoted_list(valid())
            ),
        );
        unknown.with_nearest(name, valid())
    }
}

impl Type {
    fn name(self) -> &'static str {
        match self {
            Self::Number => "a number",
            Self::Boolean => "true or false",
        }
    }
}

/// Checks that an operation has a meaning for those of its operands that are constant.
fn check_constants(
    operation: Operation,
    values: &[Value],
    arguments: &[&Expr],
) -> Result<(), ExpressionError> {
    let fault = match (operation, values) {
        (Operation::Clamp, [_, Value::Constant(low), Value::Constant(high)]) if low > high => {
            let message = format!(
                "`clamp` takes a number, a minimum and a maximum: the minimum {low} is above the maximum {high}"
            );
            Some((1, message))
        }
        (Operation::Divide, [_, Value::Constant(0.0)]) => {
            Some((1, "division by 0: expected another number".to_owned()))
        }
        (Operation::Remainder, [_, Value::Constant(0.0)]) => Some((
            1,
            "remainder of a division by 0: expected another number".to_owned(),
        )),
        _ => None,
    };
    fault.map_or(Ok(()), |(argument, message)| {
        Err(error(start_of(arguments[argument]), message))
    })
}

fn literal_value(literal: &ExprLit) -> TypedValueResult {
    let is_lost = |number: f32, digits: &str| {
        number.abs() < f32::MIN_POSITIVE && digits.parse::<f64>() != Ok(0.0)
    };
    let parse_number = |digits: &str, suffix: &str| match digits.parse::<f32>() {
        _ if !suffix.is_empty() => Err(error(
            literal.lit.span(),
            format!("a number takes no suffix, found `{suffix}`"),
        )),
        Ok(number) if is_lost(number, digits) => {
            Err(error(literal.lit.span(), "the number is too small"))
        }
        Ok(number) if number.is_finite() => Ok((Value::Constant(number), Type::Number)),
        _ => Err(error(literal.lit.span(), "the number is too large")),
    };
    match &literal.lit {
        Lit::Int(integer) => parse_number(integer.base10_digits(), integer.suffix()),
        Lit::Float(float) => parse_number(float.base10_digits(), float.suffix()),
        Lit::Bool(boolean) => Ok((
            Value::Constant(f32::from(u8::from(boolean.value))),
            Type::Boolean,
        )),
        _ => Err(error(literal.lit.span(), NOT_A_FORMULA)),
    }
}

fn unknown_function(name: &str, span: Span) -> ExpressionError {
    let valid = || FUNCTIONS.iter().copied().chain(["previous"]);
    let unknown = error(
        span,
        format!(
            "no function is named `{name}`, expected one of {}",
            quoted_list(valid())
        ),
    );
    unknown.with_nearest(name, valid())
}

const POWER_HELP: &str = "write a power as `pow(x, y)`";

pub(super) const NOT_A_FORMULA: &str = "not allowed in a formula, which consists of numbers, names, operators, function calls and `if … { … } else { … }`";

/// The error of a Rust expression that is not allowed in formulas.
fn not_a_formula(expression: &Expr) -> ExpressionError {
    let error = error(start_of(expression), NOT_A_FORMULA);
    match expression {
        Expr::Assign(_) => error.with_help("write equality as `==`"),
        Expr::MethodCall(_) => {
            error.with_help("write a function before its argument, as in `abs(x)`")
        }
        Expr::Path(_) | Expr::Field(_) => {
            error.with_help("a name consists of letters, digits and `_`")
        }
        _ => error,
    }
}

/// The message of syn if brackets do not match or a character cannot begin a token. The error does
/// not say where; [`tokenization_error`] finds the position.
const TOKENIZER_MESSAGE: &str = "cannot parse string into token stream";

fn syntax_error(text: &str, parse_error: &syn::Error) -> ExpressionError {
    let found = error(parse_error.span(), parse_error.to_string());
    if found.message == TOKENIZER_MESSAGE {
        let other_error = || error(parse_error.span(), "this is not a formula");
        return tokenization_error(text).unwrap_or_else(other_error);
    }
    if found.message.starts_with("unexpected end of input") {
        let (line, last) = text.lines().enumerate().last().unwrap_or_default();
        return ExpressionError {
            line,
            column: last.trim_end().chars().count(),
            ..found
        };
    }
    let line = text.lines().nth(found.line).unwrap_or_default();
    let help = other_language_hint(line, found.column);
    ExpressionError {
        help: help.map(str::to_owned),
        ..found
    }
}

/// How to write something of another programming language as a formula.
fn other_language_hint(line: &str, column: usize) -> Option<&'static str> {
    let at = line
        .char_indices()
        .nth(column)
        .map_or(line.len(), |(at, _)| at);
    let (before, rest) = line.split_at(at);
    match rest.split(|c: char| !c.is_alphanumeric()).next() {
        Some("and") => Some("write `&&` for \"and\""),
        Some("or") => Some("write `||` for \"or\""),
        Some("if") if !before.trim().is_empty() => {
            Some("write a choice as `if … { … } else { … }`")
        }
        _ if before.trim_end().ends_with("not") => Some("write `!` for \"not\""),
        _ if before.trim_end().ends_with('?') => Some("write a choice as `if … { … } else { … }`"),
        _ => None,
    }
}

fn error(span: Span, message: impl Into<String>) -> ExpressionError {
    let start = span.start();
    ExpressionError {
        message: message.into(),
        help: None,
        line: start.line.saturating_sub(1),
        column: start.column,
    }
}

/// The place where an expression begins.
fn start_of(expression: &Expr) -> Span {
    match expression {
        Expr::Assign(assign) => start_of(&assign.left),
        Expr::Binary(binary) => start_of(&binary.left),
        Expr::Block(block) => block.block.brace_token.span.open(),
        Expr::Call(call) => start_of(&call.func),
        Expr::Cast(cast) => start_of(&cast.expr),
        Expr::Field(field) => start_of(&field.base),
        Expr::If(choice) => choice.if_token.span,
        Expr::Index(index) => start_of(&index.expr),
        Expr::Lit(literal) => literal.lit.span(),
        Expr::MethodCall(call) => start_of(&call.receiver),
        Expr::Paren(paren) => paren.paren_token.span.open(),
        Expr::Path(path) => path
            .path
            .segments
            .first()
            .map_or_else(Span::call_site, |segment| segment.ident.span()),
        Expr::Tuple(tuple) => tuple.paren_token.span.open(),
        Expr::Unary(unary) => match &unary.op {
            UnOp::Neg(token) => token.span,
            UnOp::Not(token) => token.span,
            UnOp::Deref(token) => token.span,
            _ => start_of(&unary.expr),
        },
        _ => Span::call_site(),
    }
}
