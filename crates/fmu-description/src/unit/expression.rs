//! The parser of unit expressions.

use super::names::{self, Named};
use super::{BaseUnit, UnitError};

/// The product of the units parsed so far, `numerator / denominator * 10^ten`. The parts are separate, so that `mm3`
/// has exactly the factor of the literal 1e-9.
struct Product {
    /// Exponents of kg, m, s, A, K, mol, cd, rad.
    exponents: [i32; 8],
    numerator: f64,
    denominator: f64,
    ten: i32,
}

impl Product {
    /// Multiplies by `unit` to the power `exponent`.
    fn multiply(&mut self, unit: &Named, exponent: i32) {
        for (sum, exponent_of_unit) in self.exponents.iter_mut().zip(unit.exponents) {
            *sum += exponent_of_unit * exponent;
        }
        self.ten += unit.ten * exponent;
        if exponent >= 0 {
            self.numerator *= power(unit.factor, exponent.unsigned_abs());
        } else {
            self.denominator *= power(unit.factor, exponent.unsigned_abs());
        }
    }

    fn factor(&self) -> f64 {
        let (mut numerator, mut denominator) = (self.numerator, self.denominator);
        if self.ten >= 0 {
            numerator *= power(10.0, self.ten.unsigned_abs());
        } else {
            denominator *= power(10.0, self.ten.unsigned_abs());
        }
        numerator / denominator
    }
}

/// Returns `base` to the power `exponent`, with the same rounding on every platform, because the factor
/// determines the GUID of a description. The rounding of `powi` is unspecified.
fn power(mut base: f64, mut exponent: u32) -> f64 {
    let mut result = 1.0;
    while exponent > 0 {
        if exponent & 1 == 1 {
            result *= base;
        }
        base *= base;
        exponent >>= 1;
    }
    result
}

/// A position in an expression.
pub(super) struct Cursor<'a> {
    expression: &'a str,
    at: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(expression: &'a str) -> Self {
        Cursor { expression, at: 0 }
    }

    fn rest(&self) -> &'a str {
        &self.expression[self.at..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    /// Moves past the longest run of characters for which `belongs` is true, and returns the run.
    fn take(&mut self, belongs: impl Fn(char) -> bool) -> &'a str {
        let rest = self.rest();
        let length = rest.find(|character| !belongs(character)).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    /// Moves past the next character if it is one of `characters`; returns whether it is.
    fn accept(&mut self, characters: &[char]) -> bool {
        let character = self.peek().filter(|character| characters.contains(character));
        self.at += character.map_or(0, char::len_utf8);
        character.is_some()
    }

    /// Moves past blanks; returns whether there are any.
    fn skip_blanks(&mut self) -> bool {
        !self.take(|character| character == ' ').is_empty()
    }

    /// Returns the column of the byte `at`, counted in characters from 1.
    fn column(&self, at: usize) -> usize {
        self.expression[..at].chars().count() + 1
    }

    /// Returns the syntax error at this position.
    fn syntax(&self, expected: &'static str) -> UnitError {
        let actual = self.peek().map_or("the end".to_owned(), |character| format!("{character:?}"));
        let column = self.column(self.at);
        UnitError::Syntax { expression: self.expression.to_owned(), column, expected, actual }
    }

    /// Parses a whole expression: a unit with an offset, or a product with divisions.
    pub(super) fn unit(&mut self) -> Result<BaseUnit, UnitError> {
        self.skip_blanks();
        if let Some(scale) = names::scale(self.rest().trim_end()) {
            return Ok(BaseUnit::from_exponents(scale.exponents, scale.factor, scale.offset));
        }
        let mut product = Product { exponents: [0; 8], numerator: 1.0, denominator: 1.0, ten: 0 };
        if self.peek().is_some() {
            self.product(&mut product, 1)?;
        }
        self.denominators(&mut product)?;
        let factor = product.factor();
        if !(1e-300..=1e300).contains(&factor) {
            let (expression, actual) = (self.expression.to_owned(), format!("{factor:?}"));
            return Err(UnitError::Magnitude { expression, actual });
        }
        Ok(BaseUnit::from_exponents(product.exponents, factor, 0.0))
    }

    /// Parses `{ "/" ( factor | "(" product ")" ) }` up to the end.
    fn denominators(&mut self, product: &mut Product) -> Result<(), UnitError> {
        loop {
            self.skip_blanks();
            if self.peek().is_none() {
                return Ok(());
            }
            if !self.accept(&['/']) {
                return Err(self.syntax(
                    "'/' or the end (several units below the stroke stand in parentheses, as in \
                     J/(kg.K))",
                ));
            }
            self.skip_blanks();
            if !self.accept(&['(']) {
                self.factor(product, -1)?;
                continue;
            }
            self.skip_blanks();
            self.product(product, -1)?;
            if !self.accept(&[')']) {
                return Err(self.syntax("')' or a further unit"));
            }
        }
    }

    /// Parses `factor { ( "." | "*" | blank ) factor }` with the blanks after it. `sign` is -1 in a denominator.
    fn product(&mut self, product: &mut Product, sign: i32) -> Result<(), UnitError> {
        self.factor(product, sign)?;
        loop {
            let blank = self.skip_blanks();
            let separator = self.accept(&['.', '*']);
            if separator {
                self.skip_blanks();
            } else if !(blank && self.peek().is_some_and(in_name)) {
                return Ok(());
            }
            self.factor(product, sign)?;
        }
    }

    /// Parses `"1" | name [ exponent ]`.
    fn factor(&mut self, product: &mut Product, sign: i32) -> Result<(), UnitError> {
        if self.accept(&['1']) {
            return Ok(());
        }
        let start = self.at;
        let name = self.take(in_name);
        if name.is_empty() {
            return Err(self.syntax("a unit"));
        }
        let (expression, column) = (self.expression, self.column(start));
        let Some(named) = names::find(name) else {
            let (expression, name) = (expression.to_owned(), name.to_owned());
            return Err(if names::scale(&name).is_some() {
                UnitError::Offset { expression, column, name }
            } else {
                UnitError::UnknownName { expression, column, name }
            });
        };
        product.multiply(&named, sign * self.exponent()?);
        Ok(())
    }

    /// Parses `[ "^" ] [ "+" | "-" ] digit [ digit ]`, or nothing, which means 1.
    fn exponent(&mut self) -> Result<i32, UnitError> {
        let caret = self.accept(&['^']);
        let negative = self.peek() == Some('-');
        let signed = self.accept(&['+', '-']);
        let expected = "an integer exponent of one or two digits";
        let digits = self.take(|character| character.is_ascii_digit());
        let magnitude = match digits.len() {
            0 if !caret && !signed => return Ok(1),
            1 | 2 => digits.parse().unwrap_or(0),
            0 => return Err(self.syntax(expected)),
            length => {
                self.at -= length;
                return Err(self.syntax(expected));
            }
        };
        Ok(if negative { -magnitude } else { magnitude })
    }
}

/// Whether the character is a letter, `%` or `_`. Letters beyond ASCII are ranges, because the table of all letters
/// would be a part of each FMU and of the page in the browser: the micro sign, Latin to Greek and beyond, ohm, kelvin
/// and angstrom, Chinese and Japanese.
fn in_name(character: char) -> bool {
    matches!(
        character,
        'A'..='Z' | 'a'..='z' | '%' | '_'
            | '\u{b5}' | '\u{c0}'..='\u{1fff}' | '\u{2126}' | '\u{212a}' | '\u{212b}' | '\u{2e80}'..
    )
}
