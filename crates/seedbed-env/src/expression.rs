//! Formulas of a task file: observations, reward and termination as expressions over named numbers.
//!
//! A formula is written in Rust's expression syntax. When the file is read, it is checked for
//! names, types and numbers of arguments, and compiled to a flat [`Program`]. An [`Evaluator`] runs
//! the program for all copies of a task at once. Transcendental functions are those of `libm`,
//! which give the same bits on every machine. This module must not depend on what the names mean.

mod compile;
mod delimiters;
mod error;
mod operation;

use std::ops::Range;

pub use compile::{Previous, RESERVED_NAMES, Variable, compile};
pub use error::ExpressionError;
use operation::Operation;

/// What a formula computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Type {
    /// A real number.
    Number,
    /// True or false, stored as 1 or 0.
    Boolean,
}

/// A compiled formula over the columns of a [`ValueTable`].
#[derive(Clone, Debug, PartialEq)]
pub struct Program {
    constants: Vec<f32>,
    instructions: Vec<Instruction>,
    result: Operand,
}

/// Columns of equal length, with one value per copy: `[columns × copies]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueTable {
    copies: usize,
    values: Vec<f32>,
}

/// The first columns of a [`ValueTable`], or all of them, to be read.
#[derive(Clone, Copy, Debug)]
pub struct ValueTableView<'a> {
    copies: usize,
    values: &'a [f32],
}

/// A program together with the memory in which it runs.
///
/// Each instruction is one loop over all copies, from columns into a scratch column of its own.
/// Rust's compiler turns these loops into SIMD code, which is not possible in an interpreter that
/// evaluates the whole formula copy by copy. Constants fill scratch columns too, so that operands
/// need no case distinction within a loop. Nothing is allocated after [`new`](Self::new).
#[derive(Clone, Debug)]
pub struct Evaluator {
    program: Program,
    scratch: ValueTable,
}

impl Program {
    /// The formula's value, if it does not depend on any column.
    #[must_use]
    pub fn constant(&self) -> Option<f32> {
        match self.result {
            Operand::Scratch(index) if index < self.constants.len() => Some(self.constants[index]),
            _ => None,
        }
    }

    /// Whether the formula reads any of these columns.
    #[must_use]
    pub fn reads(&self, columns: &Range<usize>) -> bool {
        let reads = |operand: &Operand| matches!(operand, Operand::Variable(index) if columns.contains(index));
        reads(&self.result)
            || self
                .instructions
                .iter()
                .flat_map(Instruction::inputs)
                .any(reads)
    }
}

impl Evaluator {
    /// Prepares to evaluate `program` over tables of `copies` copies.
    #[must_use]
    pub fn new(program: &Program, copies: usize) -> Self {
        let mut scratch =
            ValueTable::new(program.constants.len() + program.instructions.len(), copies);
        for (index, &constant) in program.constants.iter().enumerate() {
            scratch.column_mut(index).fill(constant);
        }
        Self {
            program: program.clone(),
            scratch,
        }
    }

    /// The formula's value for each of the given copies: `[copies.len()]`.
    pub fn evaluate<'a>(
        &'a mut self,
        variables: ValueTableView<'a>,
        copies: Range<usize>,
    ) -> &'a [f32] {
        if copies.len() == 1 {
            self.run_for_one(variables, copies.start);
        } else {
            self.run(variables, &copies);
        }
        match self.program.result {
            Operand::Variable(index) => &variables.column(index)[copies],
            Operand::Scratch(index) => &self.scratch.column(index)[copies],
        }
    }

    /// Computes the scratch columns of the given copies.
    fn run(&mut self, variables: ValueTableView, copies: &Range<usize>) {
        let first = self.program.constants.len();
        for (index, instruction) in self.program.instructions.iter().enumerate() {
            let (inputs, output) = self.scratch.split_at(first + index);
            let read = |operand: Operand| match operand {
                Operand::Variable(index) => &variables.column(index)[copies.clone()],
                Operand::Scratch(index) => &inputs.column(index)[copies.clone()],
            };
            let [a, b, c] = instruction.operands.map(read);
            instruction
                .operation
                .apply(&mut output[copies.clone()], a, b, c);
        }
    }

    /// Computes the scratch columns of one copy, without the overhead of loops. The bits are those
    /// of [`run`](Self::run).
    fn run_for_one(&mut self, variables: ValueTableView, copy: usize) {
        let (first, copies) = (self.program.constants.len(), self.scratch.copies);
        let scratch = &mut self.scratch.values;
        for (index, instruction) in self.program.instructions.iter().enumerate() {
            let read = |operand: Operand| match operand {
                Operand::Variable(index) => variables.column(index)[copy],
                Operand::Scratch(index) => scratch[index * copies + copy],
            };
            let [a, b, c] = instruction.operands.map(read);
            scratch[(first + index) * copies + copy] = instruction.operation.value(a, b, c);
        }
    }
}

impl ValueTable {
    /// Columns full of zeros.
    #[must_use]
    pub fn new(columns: usize, copies: usize) -> Self {
        Self {
            copies,
            values: vec![0.0; columns * copies],
        }
    }

    /// The values of one column: `[copies]`.
    #[must_use]
    pub fn column(&self, index: usize) -> &[f32] {
        &self.values[index * self.copies..][..self.copies]
    }

    /// The values of one column: `[copies]`.
    pub fn column_mut(&mut self, index: usize) -> &mut [f32] {
        &mut self.values[index * self.copies..][..self.copies]
    }

    /// All values, column by column: `[columns × copies]`.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// All values, column by column: `[columns × copies]`.
    pub fn values_mut(&mut self) -> &mut [f32] {
        &mut self.values
    }

    /// The values of one copy: `[columns]`.
    pub(crate) fn row(&self, copy: usize) -> Vec<f32> {
        let values = self.values.iter().skip(copy).step_by(self.copies);
        values.copied().collect()
    }

    /// Sets the values of one copy.   `row: [columns]`
    pub(crate) fn set_row(&mut self, copy: usize, row: &[f32]) {
        let values = self.values.iter_mut().skip(copy).step_by(self.copies);
        for (value, new) in values.zip(row) {
            *value = *new;
        }
    }

    /// Copies the columns `source` to the columns that begin with `target`.
    pub fn copy_columns(&mut self, source: Range<usize>, target: usize) {
        self.values.copy_within(
            source.start * self.copies..source.end * self.copies,
            target * self.copies,
        );
    }

    /// Several columns: `[columns × copies]`.
    #[must_use]
    pub fn columns(&self, range: Range<usize>) -> &[f32] {
        &self.values[range.start * self.copies..range.end * self.copies]
    }

    /// All columns, to be read.
    #[must_use]
    pub fn view(&self) -> ValueTableView<'_> {
        ValueTableView {
            copies: self.copies,
            values: &self.values,
        }
    }

    /// The columns before `index`, and column `index`.
    pub fn split_at(&mut self, index: usize) -> (ValueTableView<'_>, &mut [f32]) {
        let (before, rest) = self.values.split_at_mut(index * self.copies);
        (
            ValueTableView {
                copies: self.copies,
                values: before,
            },
            &mut rest[..self.copies],
        )
    }
}

impl<'a> ValueTableView<'a> {
    fn column(self, index: usize) -> &'a [f32] {
        &self.values[index * self.copies..][..self.copies]
    }
}

/// Copies numbers to a column. For a single number this takes less time than a call of `memcpy`.
pub(crate) fn copy_values(from: &[f32], to: &mut [f32]) {
    match (from, &mut *to) {
        ([value], [column]) => *column = *value,
        _ => to.copy_from_slice(from),
    }
}

/// An operation and its operands. Instruction k writes the k-th scratch column after the constants,
/// and reads only scratch columns before that.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Instruction {
    operation: Operation,
    /// Columns of the operands. Those beyond the operation's number of arguments repeat the first.
    operands: [Operand; 3],
}

/// The column of a value.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Operand {
    Variable(usize),
    Scratch(usize),
}

impl Instruction {
    fn inputs(&self) -> &[Operand] {
        &self.operands[..self.operation.argument_count()]
    }
}

#[cfg(test)]
mod tests {
    use super::compile::NOT_A_FORMULA;
    use super::*;
    use proptest::prelude::*;

    const NAMES: [&str; 3] = ["x", "x_dot", "theta"];

    fn variables() -> Vec<Variable> {
        NAMES
            .iter()
            .enumerate()
            .map(|(index, &name)| Variable {
                name: name.to_owned(),
                column: index,
                previous: [Previous::Column(3), Previous::Column(4), Previous::NotHere][index],
            })
            .collect()
    }

    /// The value of a formula with the given `x`; the other variables have fixed values.
    fn value(text: &str, kind: Type, x: f32) -> f32 {
        let program =
            compile(text, kind, &variables()).unwrap_or_else(|error| panic!("{text}: {error:?}"));
        let mut table = ValueTable::new(5, 3);
        for (column, value) in [x, 2.0, -0.5, 7.0, 8.0].into_iter().enumerate() {
            table.column_mut(column).fill(value);
        }
        let mut formula = Evaluator::new(&program, 3);
        let values = formula.evaluate(table.view(), 0..3).to_vec();
        assert_eq!(
            values[1].to_bits(),
            formula.evaluate(table.view(), 1..2)[0].to_bits()
        );
        values[1]
    }

    fn number(text: &str, x: f32) -> f32 {
        value(text, Type::Number, x)
    }

    fn boolean(text: &str, x: f32) -> f32 {
        value(text, Type::Boolean, x)
    }

    /// Column, message and help of the error of a formula.
    fn error(text: &str, kind: Type) -> (usize, String, Option<String>) {
        let error = compile(text, kind, &variables()).expect_err(text);
        (error.column, error.message, error.help)
    }

    #[test]
    fn arithmetic_is_that_of_rust() {
        assert_eq!(number("1 + 2 * x", 3.0), 7.0);
        assert_eq!(number("(1 + 2) * x", 3.0), 9.0);
        assert_eq!(number("-x - -1.5e0", 3.0), -1.5);
        assert_eq!(number("x % 2", -3.0), -1.0);
        assert_eq!(number("1 / x", 4.0), 0.25);
        assert_eq!(
            number("if x > 0 { x } else if x < -1 { -1 } else { 10 * x }", -0.5),
            -5.0
        );
    }

    #[test]
    fn logic_is_that_of_rust() {
        assert_eq!(boolean("x > 1 || x < -1", 2.0), 1.0);
        assert_eq!(boolean("x > 1 && x < -1", 2.0), 0.0);
        assert_eq!(boolean("!(x >= 1) && true", 0.5), 1.0);
        assert_eq!(boolean("x == 2 && x != 3 && x <= 2", 2.0), 1.0);
        assert_eq!(boolean("if x > 1 { theta < 0 } else { false }", 2.0), 1.0);
        assert_eq!(
            boolean("x < 1 || x >= 1", f32::NAN),
            0.0,
            "a comparison with NaN is false"
        );
    }

    #[test]
    fn functions_have_their_usual_values() {
        for (text, expected) in [
            ("abs(x)", 0.5),
            ("sqrt(x * x)", 0.5),
            ("exp(x)", 0.606_530_66),
            ("log(-x)", -std::f32::consts::LN_2),
            ("sin(x)", -0.479_425_54),
            ("cos(x)", 0.877_582_6),
            ("tan(x)", -0.546_302_5),
            ("atan2(x, -1)", -2.677_945),
            ("min(x, 2)", -0.5),
            ("max(x, 2)", 2.0),
            ("pow(x, 3)", -0.125),
            ("clamp(x, -0.25, 1)", -0.25),
            ("tanh(x)", -0.462_117_16),
            ("sign(x)", -1.0),
            ("floor(x)", -1.0),
            ("180 * degree", std::f32::consts::PI),
            ("2 * pi", std::f32::consts::TAU),
        ] {
            assert!(
                (number(text, -0.5) - expected).abs() < 1e-6,
                "{text} = {} instead of {expected}",
                number(text, -0.5)
            );
        }
    }

    #[test]
    fn previous_reads_the_value_before_the_step() {
        assert_eq!(number("x_dot - previous(x_dot)", 0.0), 2.0 - 8.0);
    }

    #[test]
    fn a_formula_without_names_is_a_constant() {
        let compiled = |text| compile(text, Type::Number, &variables()).unwrap();
        assert_eq!(compiled("1").constant(), Some(1.0));
        assert_eq!(
            compiled("max(2 * 3, 5) - if 1 < 2 { 1 } else { 0 }").constant(),
            Some(5.0)
        );
        assert_eq!(compiled("x").constant(), None);
        assert_eq!(compiled("x * (2 + 3)").instructions.len(), 1);
        assert!(compiled("x").reads(&(0..1)) && !compiled("x").reads(&(1..5)));
    }

    #[test]
    fn an_unknown_name_lists_the_known_ones_and_suggests_the_nearest() {
        let (column, message, help) = error("x + tehta", Type::Number);
        assert_eq!(column, 4);
        assert_eq!(
            message,
            "no variable is named `tehta`, expected one of `x`, `x_dot`, `theta`, `pi`, `degree`"
        );
        assert_eq!(help.as_deref(), Some("did you mean `theta`?"));
    }

    /// Checks column and message of the error of each formula.
    fn assert_errors(kind: Type, expected: &[(&str, usize, &str)]) {
        for &(text, column, message) in expected {
            let found = error(text, kind);
            assert_eq!((found.0, found.1.as_str()), (column, message), "{text}");
        }
    }

    #[test]
    fn type_errors_are_located() {
        let expected_number = "expected a number, found true or false";
        let expected_boolean = "expected true or false, found a number";
        assert_errors(
            Type::Number,
            &[
                ("x + (x < 1)", 4, expected_number),
                ("if x { 1 } else { 2 }", 3, expected_boolean),
                ("abs(x, 1)", 0, "`abs` takes 1 argument, found 2"),
                ("if x > 0 { 1 }", 0, "`if` needs an `else { … }`"),
            ],
        );
        assert_errors(Type::Boolean, &[("x", 0, expected_boolean)]);
    }

    #[test]
    fn syntax_errors_are_located() {
        let end = "unexpected end of input, expected an expression";
        let suffix = "a number takes no suffix, found `f32`";
        let chained = "comparison operators cannot be chained";
        assert_errors(
            Type::Number,
            &[
                ("x +", 3, end),
                ("", 0, end),
                ("\"x\"", 0, NOT_A_FORMULA),
                ("x.abs()", 0, NOT_A_FORMULA),
                ("2f32 * x", 0, suffix),
            ],
        );
        assert_errors(
            Type::Boolean,
            &[("x = 2", 0, NOT_A_FORMULA), ("1 < x < 2", 6, chained)],
        );
    }

    #[test]
    fn previous_takes_names_that_have_a_value_before_the_step() {
        let not_a_name = "`previous` takes the name of an observation or a sensor";
        let unavailable = "`previous(theta)` is not available here: only `reward` and \
                           `terminated` can read the values of observations and sensors before \
                           the step";
        assert_errors(
            Type::Number,
            &[
                ("previous(1 + x)", 9, not_a_name),
                ("previous(theta)", 9, unavailable),
            ],
        );
    }

    proptest! {
        /// The value of a copy has the same bits whether it is computed alone or among others.
        #[test]
        fn copies_are_independent(xs in prop::collection::vec(-1e3_f32..1e3, 1..40)) {
            let text = "clamp(sin(x) * 3 + x / 7, -2, 2) - if x > 1 || abs(x) < 0.5 { x % 3 } else { exp(-x * x) }";
            let program = compile(text, Type::Number, &variables()).unwrap();
            let mut table = ValueTable::new(5, xs.len());
            table.column_mut(0).copy_from_slice(&xs);
            let together = Evaluator::new(&program, xs.len()).evaluate(table.view(), 0..xs.len()).to_vec();
            for (&x, together) in xs.iter().zip(together) {
                let mut single = ValueTable::new(5, 1);
                single.column_mut(0)[0] = x;
                prop_assert_eq!(Evaluator::new(&program, 1).evaluate(single.view(), 0..1)[0].to_bits(), together.to_bits());
            }
        }
    }

    #[test]
    fn too_long_formulas_are_rejected_before_parsing() {
        let deeply_nested = format!("{}1{}", "(".repeat(100_000), ")".repeat(100_000));
        let error = compile(&deeply_nested, Type::Number, &[]).unwrap_err();
        assert_eq!(
            error.message,
            "a formula can have at most 1000 characters, this one has 200001"
        );
        let allowed = format!("{}1{}", "(".repeat(499), ")".repeat(499));
        assert!(compile(&allowed, Type::Number, &[]).is_ok());
    }
}
