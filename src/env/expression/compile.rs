//! From a formula's text to its program: parse, check, fold what is constant, flatten.

use proc_macro2::Span;
use syn::{BinOp, Block, Expr, ExprBinary, ExprCall, ExprIf, ExprLit, ExprUnary, Lit, Stmt, UnOp};

use super::delimiters::broken_word;
use super::operation::{FUNCTIONS, Operation};
use super::{Instruction, Place, Program, Type};
use crate::input::{listed, nearest};

/// A name that a formula may use.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Variable {
    /// As it is written.
    pub name: String,
    /// The column of its value now.
    pub column: usize,
    /// The column of its value before the step, which `previous(name)` reads; actions have none.
    pub previous: Option<usize>,
}

/// What is wrong with a formula, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mistake {
    /// What is wrong and what was expected.
    pub message: String,
    /// What the user may have meant.
    pub help: Option<String>,
    /// Line within the formula, from 0.
    pub line: usize,
    /// Character within that line, from 0.
    pub column: usize,
}

/// Names that mean something in every formula and cannot name anything else.
pub const RESERVED: [&str; 3] = ["pi", "degree", "previous"];

/// Characters in a formula. Bounds how deep it can be nested, and with it the stack that reading it takes.
const LONGEST: usize = 1000;

/// Compiles a formula of the given type over `variables`.
///
/// # Errors
/// The text is no formula, names something unknown, or has another type.
pub fn compile(text: &str, expected: Type, variables: &[Variable]) -> Result<Program, Mistake> {
    if text.len() > LONGEST {
        let message = format!(
            "a formula has at most {LONGEST} characters, this one has {}",
            text.len()
        );
        return Err(Mistake {
            message,
            help: None,
            line: 0,
            column: 0,
        });
    }
    let expression = syn::parse_str::<Expr>(text).map_err(|error| syntax_mistake(text, &error))?;
    let mut compiler = Compiler {
        variables,
        constants: Vec::new(),
        instructions: Vec::new(),
    };
    let result = compiler.typed(&expression, expected)?;
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
    /// Of the instruction with this index.
    Result(usize),
}

/// Shorthand: each part has a value and a type.
type Part = Result<(Value, Type), Mistake>;

impl Compiler<'_> {
    /// The part's value, if its type is the expected one.
    fn typed(&mut self, expression: &Expr, expected: Type) -> Result<Value, Mistake> {
        match self.part(expression)? {
            (value, found) if found == expected => Ok(value),
            (_, found) => {
                let mistake = mistake(
                    start(expression),
                    format!("expected {}, found {}", expected.words(), found.words()),
                );
                Err(if expected == Type::Number {
                    mistake.with_help("a condition becomes a number by `if … { 1 } else { 0 }`")
                } else {
                    mistake
                })
            }
        }
    }

    fn part(&mut self, expression: &Expr) -> Part {
        match expression {
            Expr::Lit(literal) => literal_value(literal),
            Expr::Paren(inner) => self.part(&inner.expr),
            Expr::Path(path) => match path.path.get_ident() {
                Some(name) => self.name(&name.to_string(), name.span()),
                None => Err(foreign(expression)),
            },
            Expr::Unary(unary) => self.unary(unary, expression),
            Expr::Binary(binary) => self.binary(binary, expression),
            Expr::Call(call) => self.call(call),
            Expr::If(choice) => self.choice(choice),
            Expr::Block(block) => self.block(&block.block),
            other => Err(foreign(other)),
        }
    }

    fn name(&mut self, name: &str, span: Span) -> Part {
        match name {
            "pi" => Ok((Value::Constant(std::f32::consts::PI), Type::Number)),
            "degree" => Ok((Value::Constant(std::f32::consts::PI / 180.0), Type::Number)),
            _ => match self.variables.iter().find(|variable| variable.name == name) {
                Some(variable) => Ok((Value::Variable(variable.column), Type::Number)),
                None => Err(self.unknown_name(name, span)),
            },
        }
    }

    fn unary(&mut self, unary: &ExprUnary, whole: &Expr) -> Part {
        match &unary.op {
            UnOp::Neg(_) => self.apply(Operation::Negate, &[&unary.expr]),
            UnOp::Not(_) => self.apply(Operation::Not, &[&unary.expr]),
            UnOp::Deref(token) => {
                Err(mistake(token.span, NO_FORMULA).with_help("a power is written `pow(x, y)`"))
            }
            _ => Err(foreign(whole)),
        }
    }

    fn binary(&mut self, binary: &ExprBinary, whole: &Expr) -> Part {
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
            BinOp::BitXor(token) => Err(mistake(token.span, "`^` is no operator of formulas")
                .with_help("a power is written `pow(x, y)`")),
            _ => Err(foreign(whole)),
        }
    }

    fn call(&mut self, call: &ExprCall) -> Part {
        let Expr::Path(path) = &*call.func else {
            return Err(foreign(&call.func));
        };
        let Some(function) = path.path.get_ident() else {
            return Err(foreign(&call.func));
        };
        let (name, arguments) = (function.to_string(), call.args.iter().collect::<Vec<_>>());
        let parameters = match Operation::named(&name) {
            Some(operation) => operation.arguments(),
            None if name == "previous" => 1,
            None => return Err(unknown_function(&name, function.span())),
        };
        if arguments.len() != parameters {
            let plural = if parameters == 1 { "" } else { "s" };
            let message = format!(
                "`{name}` takes {parameters} argument{plural}, found {}",
                arguments.len()
            );
            return Err(mistake(function.span(), message));
        }
        match Operation::named(&name) {
            Some(operation) => self.apply(operation, &arguments),
            None => self.previous(arguments[0]),
        }
    }

    fn previous(&mut self, argument: &Expr) -> Part {
        let name = match argument {
            Expr::Path(path) => path.path.get_ident(),
            _ => None,
        };
        let Some(name) = name else {
            return Err(mistake(
                start(argument),
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
        let column = variable.previous.ok_or_else(|| {
            let message = "has no previous value here: rewards and endings look back, at observations and sensors";
            mistake(name.span(), format!("`{name}` {message}"))
        })?;
        Ok((Value::Variable(column), Type::Number))
    }

    /// Both branches are computed and one is taken: formulas have no side effects.
    fn choice(&mut self, choice: &ExprIf) -> Part {
        let condition = self.typed(&choice.cond, Type::Boolean)?;
        let Some((_, otherwise)) = &choice.else_branch else {
            return Err(mistake(choice.if_token.span, "an `if` needs an `else`"));
        };
        let (first, kind) = self.block(&choice.then_branch)?;
        let second = self.typed(otherwise, kind)?;
        let operation = match kind {
            Type::Number => Operation::ChooseNumber,
            Type::Boolean => Operation::ChooseBoolean,
        };
        Ok((self.emit(operation, vec![condition, first, second]), kind))
    }

    fn block(&mut self, block: &Block) -> Part {
        match &block.stmts[..] {
            [Stmt::Expr(expression, None)] => self.part(expression),
            _ => Err(mistake(
                block.brace_token.span.open(),
                "expected one expression between the braces",
            )),
        }
    }

    fn apply(&mut self, operation: Operation, arguments: &[&Expr]) -> Part {
        let parameters = operation.parameters().iter();
        let values = arguments
            .iter()
            .zip(parameters)
            .map(|(argument, &kind)| self.typed(argument, kind));
        let values = values.collect::<Result<Vec<_>, _>>()?;
        Ok((self.emit(operation, values), operation.result()))
    }

    /// The operation's value: at once if all operands are constant, else by an instruction.
    fn emit(&mut self, operation: Operation, operands: Vec<Value>) -> Value {
        let constant = |value: &Value| {
            if let Value::Constant(constant) = value {
                Some(*constant)
            } else {
                None
            }
        };
        if let Some(constants) = operands.iter().map(constant).collect::<Option<Vec<_>>>() {
            return Value::Constant(operation.value(&constants));
        }
        self.instructions.push((operation, operands));
        Value::Result(self.instructions.len() - 1)
    }

    /// Numbers the scratch columns: constants first, then one for each instruction.
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
        let place = |value: &Value| match *value {
            Value::Variable(column) => Place::Variable(column),
            Value::Result(index) => Place::Scratch(self.constants.len() + index),
            Value::Constant(constant) => Place::Scratch(
                self.constants
                    .iter()
                    .take_while(|known| known.to_bits() != constant.to_bits())
                    .count(),
            ),
        };
        let instruction = |(operation, operands): &(Operation, Vec<Value>)| Instruction {
            operation: *operation,
            places: std::array::from_fn(|index| place(operands.get(index).unwrap_or(&operands[0]))),
        };
        let instructions = self.instructions.iter().map(instruction).collect();
        Program {
            instructions,
            result: place(&result),
            constants: self.constants,
        }
    }

    fn unknown_name(&self, name: &str, span: Span) -> Mistake {
        let valid = || {
            self.variables
                .iter()
                .map(|variable| variable.name.as_str())
                .chain(["pi", "degree"])
        };
        let unknown = mistake(
            span,
            format!(
                "no variable is named `{name}`, expected one of {}",
                listed(valid())
            ),
        );
        unknown.with_nearest(name, valid())
    }
}

impl Type {
    fn words(self) -> &'static str {
        match self {
            Self::Number => "a number",
            Self::Boolean => "true or false",
        }
    }
}

impl Mistake {
    fn with_help(mut self, help: &str) -> Self {
        self.help = Some(help.to_owned());
        self
    }

    fn with_nearest<'a>(mut self, name: &str, valid: impl Iterator<Item = &'a str>) -> Self {
        self.help = nearest(name, valid).map(|near| format!("did you mean `{near}`?"));
        self
    }
}

fn literal_value(literal: &ExprLit) -> Part {
    let number = |digits: &str, suffix: &str| match digits.parse::<f32>() {
        _ if !suffix.is_empty() => Err(mistake(
            literal.lit.span(),
            format!("a number takes no suffix, found `{suffix}`"),
        )),
        Ok(number) if number.is_finite() => Ok((Value::Constant(number), Type::Number)),
        _ => Err(mistake(literal.lit.span(), "the number is too large")),
    };
    match &literal.lit {
        Lit::Int(integer) => number(integer.base10_digits(), integer.suffix()),
        Lit::Float(float) => number(float.base10_digits(), float.suffix()),
        Lit::Bool(boolean) => Ok((
            Value::Constant(f32::from(u8::from(boolean.value))),
            Type::Boolean,
        )),
        _ => Err(mistake(literal.lit.span(), NO_FORMULA)),
    }
}

fn unknown_function(name: &str, span: Span) -> Mistake {
    let valid = || FUNCTIONS.iter().copied().chain(["previous"]);
    let unknown = mistake(
        span,
        format!(
            "no function is named `{name}`, expected one of {}",
            listed(valid())
        ),
    );
    unknown.with_nearest(name, valid())
}

pub(super) const NO_FORMULA: &str = "this is not part of a formula, which has numbers, names, operators, function calls, and `if … { … } else { … }`";

/// Complains about Rust that is no formula.
fn foreign(expression: &Expr) -> Mistake {
    let mistake = mistake(start(expression), NO_FORMULA);
    match expression {
        Expr::Assign(_) => mistake.with_help("equality is written `==`"),
        Expr::MethodCall(_) => {
            mistake.with_help("functions are written before their arguments, as in `abs(x)`")
        }
        Expr::Path(_) | Expr::Field(_) => {
            mistake.with_help("a name is one word of letters, digits and `_`")
        }
        _ => mistake,
    }
}

/// What the parser says where brackets do not match, or where a character begins no word.
const NO_WORDS: &str = "cannot parse string into token stream";

fn syntax_mistake(text: &str, error: &syn::Error) -> Mistake {
    let found = mistake(error.span(), error.to_string());
    if found.message == NO_WORDS {
        let unknown = || mistake(error.span(), "this is no formula");
        return broken_word(text).unwrap_or_else(unknown);
    }
    if found.message.starts_with("unexpected end of input") {
        let (line, last) = text.lines().enumerate().last().unwrap_or_default();
        return Mistake {
            line,
            column: last.trim_end().chars().count(),
            ..found
        };
    }
    let help = habit(
        text.lines().nth(found.line).unwrap_or_default(),
        found.column,
    );
    Mistake {
        help: help.map(str::to_owned),
        ..found
    }
}

/// How what stands here in other languages is written in formulas.
fn habit(line: &str, column: usize) -> Option<&'static str> {
    let at = line
        .char_indices()
        .nth(column)
        .map_or(line.len(), |(at, _)| at);
    let (before, rest) = line.split_at(at);
    match rest.split(|c: char| !c.is_alphanumeric()).next() {
        Some("and") => Some("both conditions are joined by `&&`"),
        Some("or") => Some("either condition is enough with `||`"),
        _ if before.trim_end().ends_with('?') => {
            Some("a choice is written `if … { … } else { … }`")
        }
        _ => None,
    }
}

fn mistake(span: Span, message: impl Into<String>) -> Mistake {
    let start = span.start();
    Mistake {
        message: message.into(),
        help: None,
        line: start.line.saturating_sub(1),
        column: start.column,
    }
}

/// Where an expression begins.
fn start(expression: &Expr) -> Span {
    match expression {
        Expr::Assign(assign) => start(&assign.left),
        Expr::Binary(binary) => start(&binary.left),
        Expr::Block(block) => block.block.brace_token.span.open(),
        Expr::Call(call) => start(&call.func),
        Expr::Cast(cast) => start(&cast.expr),
        Expr::Field(field) => start(&field.base),
        Expr::If(choice) => choice.if_token.span,
        Expr::Index(index) => start(&index.expr),
        Expr::Lit(literal) => literal.lit.span(),
        Expr::MethodCall(call) => start(&call.receiver),
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
            _ => start(&unary.expr),
        },
        _ => Span::call_site(),
    }
}
