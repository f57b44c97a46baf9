//! The operations of programs. One line defines an operation: its name in task files, the types of
//! its operands and its result, and the function that computes it. Operators have no name.

use super::Type::{self, Boolean, Number};

macro_rules! operations {
    ($($variant:ident($($name:literal)?) [$($argument:ident: $kind:ident),*] -> $result:ident = $value:expr;)*) => {
        /// An operation on one, two or three operands.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub(super) enum Operation { $($variant,)* }

        impl Operation {
            /// The function that a file calls by `name`.
            pub(super) fn named(name: &str) -> Option<Self> {
                match name { $($($name => Some(Self::$variant),)?)* _ => None }
            }

            /// Types of the operands.
            pub(super) fn parameters(self) -> &'static [Type] {
                match self { $(Self::$variant => &[$($kind),*],)* }
            }

            /// Type of the value.
            pub(super) fn result(self) -> Type {
                match self { $(Self::$variant => $result,)* }
            }

            /// Computes `out` for each copy. Operands beyond the number of operands are not read.
            pub(super) fn apply(self, out: &mut [f32], a: &[f32], b: &[f32], c: &[f32]) {
                match self { $(Self::$variant => operations!(@loop out a b c [$($argument)*] $value),)* }
            }

            /// The result for one value per operand. Operands beyond the number of operands are not
            /// used.
            pub(super) fn value(self, a: f32, b: f32, c: f32) -> f32 {
                match self { $(Self::$variant => operations!(@value a b c [$($argument)*] $value),)* }
            }
        }

        /// Names of all functions.
        pub(super) const FUNCTIONS: &[&str] = &[$($($name,)?)*];
    };
    (@value $a:ident $b:ident $c:ident [$x:ident] $value:expr) => {{ let $x = $a; $value }};
    (@value $a:ident $b:ident $c:ident [$x:ident $y:ident] $value:expr) => {{ let ($x, $y) = ($a, $b); $value }};
    (@value $a:ident $b:ident $c:ident [$x:ident $y:ident $z:ident] $value:expr) => {{
        let ($x, $y, $z) = ($a, $b, $c);
        $value
    }};
    (@loop $out:ident $a:ident $b:ident $c:ident [$x:ident] $value:expr) => {
        for (out, &$x) in $out.iter_mut().zip($a) { *out = $value; }
    };
    (@loop $out:ident $a:ident $b:ident $c:ident [$x:ident $y:ident] $value:expr) => {
        for ((out, &$x), &$y) in $out.iter_mut().zip($a).zip($b) { *out = $value; }
    };
    (@loop $out:ident $a:ident $b:ident $c:ident [$x:ident $y:ident $z:ident] $value:expr) => {
        for (((out, &$x), &$y), &$z) in $out.iter_mut().zip($a).zip($b).zip($c) { *out = $value; }
    };
}

operations! {
    Add() [x: Number, y: Number] -> Number = x + y;
    Subtract() [x: Number, y: Number] -> Number = x - y;
    Multiply() [x: Number, y: Number] -> Number = x * y;
    Divide() [x: Number, y: Number] -> Number = x / y;
    Remainder() [x: Number, y: Number] -> Number = x % y;
    Negate() [x: Number] -> Number = -x;
    Less() [x: Number, y: Number] -> Boolean = truth_value(x < y);
    LessOrEqual() [x: Number, y: Number] -> Boolean = truth_value(x <= y);
    Equal() [x: Number, y: Number] -> Boolean = truth_value(x == y);
    NotEqual() [x: Number, y: Number] -> Boolean = truth_value(x != y);
    And() [x: Boolean, y: Boolean] -> Boolean = x * y;
    Or() [x: Boolean, y: Boolean] -> Boolean = x + y - x * y;
    Not() [x: Boolean] -> Boolean = 1.0 - x;
    ChooseNumber() [x: Boolean, y: Number, z: Number] -> Number = if x == 0.0 { z } else { y };
    ChooseBoolean() [x: Boolean, y: Boolean, z: Boolean] -> Boolean = if x == 0.0 { z } else { y };
    Abs("abs") [x: Number] -> Number = x.abs();
    Sqrt("sqrt") [x: Number] -> Number = x.sqrt();
    Exp("exp") [x: Number] -> Number = libm::expf(x);
    Log("log") [x: Number] -> Number = libm::logf(x);
    Sin("sin") [x: Number] -> Number = libm::sinf(x);
    Cos("cos") [x: Number] -> Number = libm::cosf(x);
    Tan("tan") [x: Number] -> Number = libm::tanf(x);
    Atan2("atan2") [y: Number, x: Number] -> Number = libm::atan2f(y, x);
    Min("min") [x: Number, y: Number] -> Number = if y < x { y } else { x };
    Max("max") [x: Number, y: Number] -> Number = if y > x { y } else { x };
    Power("pow") [x: Number, y: Number] -> Number = libm::powf(x, y);
    Clamp("clamp") [x: Number, low: Number, high: Number] -> Number = if x < low { low } else if x > high { high } else { x };
    Tanh("tanh") [x: Number] -> Number = libm::tanhf(x);
    Sign("sign") [x: Number] -> Number = if x > 0.0 { 1.0 } else if x < 0.0 { -1.0 } else { x };
    Floor("floor") [x: Number] -> Number = x.floor();
}

impl Operation {
    /// The operation in a message: that of a function is its name.
    pub(super) fn description(self) -> String {
        let function = FUNCTIONS
            .iter()
            .find(|name| Self::named(name) == Some(self));
        function.map_or_else(|| "the result".to_owned(), |name| format!("`{name}`"))
    }

    /// Number of operands.
    pub(super) fn argument_count(self) -> usize {
        self.parameters().len()
    }
}

fn truth_value(condition: bool) -> f32 {
    f32::from(u8::from(condition))
}
