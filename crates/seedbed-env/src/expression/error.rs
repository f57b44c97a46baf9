//! Errors of formulas.

use seedbed_input::nearest_name;

/// What is wrong with a formula, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ExpressionError {
    /// What is wrong and what was expected.
    pub message: String,
    /// What the user may have meant.
    pub help: Option<String>,
    /// Line within the formula, from 0.
    pub line: usize,
    /// Character within that line, from 0.
    pub column: usize,
}

impl ExpressionError {
    pub(super) fn with_help(mut self, help: &str) -> Self {
        self.help = Some(help.to_owned());
        self
    }

    pub(super) fn with_nearest<'a>(
        mut self,
        name: &str,
        valid: impl Iterator<Item = &'a str>,
    ) -> Self {
        self.help = nearest_name(name, valid).map(|near| format!("did you mean `{near}`?"));
        self
    }
}
