//! Random changes of valid inputs: of texts token by token, and of bytes.

use std::ops::Range;

use rand::RngExt;
use seedbed_random::Stream;

/// Numbers at which computations overflow, round to zero or change their sign.
const EXTREME_NUMBERS: [&str; 28] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "0.5",
    "1e-30",
    "1e-38",
    "1e-45",
    "1e-300",
    "1e-320",
    "1e30",
    "3.4028234e38",
    "3.4028236e38",
    "-3.4028234e38",
    "1.7976931348623157e308",
    "1e309",
    "inf",
    "NaN",
    "-inf",
    "127",
    "255",
    "65536",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "18446744073709551616",
];

/// Brackets of RON and of formulas.
const BRACKETS: [(&str, &str); 4] = [("(", ")"), ("[", "]"), ("{", "}"), ("\"", "\"")];

/// Texts that are changed token by token.
pub(super) struct Texts {
    texts: Vec<Vec<String>>,
    /// All different tokens.
    tokens: Vec<String>,
}

impl Texts {
    /// Texts that are valid, or nearly so.
    pub(super) fn new(texts: impl IntoIterator<Item = String>) -> Self {
        let texts: Vec<Vec<String>> = texts.into_iter().map(|text| tokens_of(&text)).collect();
        assert!(!texts.is_empty(), "there are texts to change");
        let mut tokens: Vec<String> = texts.iter().flatten().cloned().collect();
        tokens.sort();
        tokens.dedup();
        Self { texts, tokens }
    }

    /// One of the texts with a few changes.
    pub(super) fn mutated(&self, random: &mut Stream) -> Vec<u8> {
        let mut text = any(&self.texts, random).clone();
        for _ in 0..random.random_range(1..=4) {
            self.change(&mut text, random);
        }
        let mut bytes = text.concat().into_bytes();
        if random.random_ratio(1, 10) {
            change_bytes(&mut bytes, &[], random);
        }
        bytes
    }

    fn change(&self, text: &mut Vec<String>, random: &mut Stream) {
        if text.is_empty() {
            text.push(any(&self.tokens, random).clone());
        }
        let at = random.random_range(0..text.len());
        match random.random_range(0..10) {
            0 => {
                let other = random.random_range(0..text.len());
                text.swap(at, other);
            }
            1 | 2 => replace_number(text, at, random),
            3 => drop(text.drain(part(text.len(), random))),
            4 => {
                let copy = text[part(text.len(), random)].to_vec();
                text.splice(at..at, copy);
            }
            5 => {
                let other = any(&self.texts, random);
                let copy = other[part(other.len(), random)].to_vec();
                let replaced = part(text.len(), random);
                text.splice(replaced, copy);
            }
            6 => nest(&mut text[at], random),
            7 => text.insert(at, any(&self.tokens, random).clone()),
            8 => {
                let other = any(&self.texts, random);
                text[at] = any(other, random).clone();
            }
            _ => text[at] = any(&self.tokens, random).clone(),
        }
    }
}

/// Replaces the next number after `start` by an extreme one.
fn replace_number(text: &mut [String], start: usize, random: &mut Stream) {
    let is_number = |token: &String| token.starts_with(|c: char| c.is_ascii_digit());
    if let Some(at) = (start..text.len()).find(|&at| is_number(&text[at])) {
        text[at] = any(&EXTREME_NUMBERS, random).to_string();
    }
}

/// Puts a token into brackets: usually a few, sometimes very many.
fn nest(token: &mut String, random: &mut Stream) {
    let (open, close) = any(&BRACKETS, random);
    let depth = [1, 2, 60, 200, 30_000][random.random_range(0..5)];
    *token = open.repeat(depth) + token + &close.repeat(depth);
}

/// Words, numbers, spaces, and single other characters, which make up the text. What is in quotes is
/// split as well, because it may be a formula.
fn tokens_of(text: &str) -> Vec<String> {
    let kind = |c: char| match c {
        _ if c.is_alphanumeric() || c == '_' || c == '.' => 1,
        _ if c.is_whitespace() => 2,
        _ => 3,
    };
    let mut tokens: Vec<String> = Vec::new();
    let mut last_kind = 0;
    for character in text.chars() {
        match tokens.last_mut() {
            Some(token) if kind(character) == last_kind && last_kind != 3 => token.push(character),
            _ => tokens.push(character.to_string()),
        }
        last_kind = kind(character);
    }
    tokens
}

/// One of several values, of which there is at least one.
pub(super) fn any<'a, T>(values: &'a [T], random: &mut Stream) -> &'a T {
    &values[random.random_range(0..values.len())]
}

/// A random part of a list: usually a short one.
fn part(length: usize, random: &mut Stream) -> Range<usize> {
    let start = random.random_range(0..=length);
    let max = if random.random_ratio(1, 4) {
        length
    } else {
        12
    };
    start..(start + random.random_range(0..=max)).min(length)
}

/// Changes bytes in a few places. `others` are other inputs, of which parts may be inserted.
pub(super) fn change_bytes(bytes: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Stream) {
    for _ in 0..random.random_range(1..=4) {
        change_bytes_once(bytes, others, random);
    }
}

fn change_bytes_once(bytes: &mut Vec<u8>, others: &[Vec<u8>], random: &mut Stream) {
    if bytes.is_empty() {
        bytes.push(random.random());
    }
    let at = random.random_range(0..bytes.len());
    match random.random_range(0..8) {
        0 => bytes[at] ^= 1 << random.random_range(0..8),
        1 => bytes[at] = *any(&[0, 1, 2, 0x7f, 0x80, 0xfe, 0xff], random),
        2 => overwrite(bytes, at, &extreme_number(random)),
        3 => drop(bytes.drain(part(bytes.len(), random))),
        4 => {
            let copy = bytes[part(bytes.len(), random)].to_vec();
            bytes.splice(at..at, copy);
        }
        5 => bytes.truncate(at),
        6 if !others.is_empty() => {
            let other = any(others, random);
            let copy = other[part(other.len(), random)].to_vec();
            let replaced = part(bytes.len(), random);
            bytes.splice(replaced, copy);
        }
        _ => {
            let inserted = extreme_number(random);
            bytes.splice(at..at, inserted);
        }
    }
}

fn overwrite(bytes: &mut [u8], at: usize, new: &[u8]) {
    bytes[at..]
        .iter_mut()
        .zip(new)
        .for_each(|(byte, new)| *byte = *new);
}

/// An extreme number as stored files have them: integers of fixed and of variable length, and
/// floating-point numbers.
fn extreme_number(random: &mut Stream) -> Vec<u8> {
    match random.random_range(0..6) {
        0 => vec![0xff; 4],
        1 => vec![0xff; 8],
        // Integers of variable length: the largest of 32 and of 64 bits, and a large length.
        2 => vec![0xff, 0xff, 0xff, 0xff, 0x0f],
        3 => [vec![0xff; 9], vec![0x01]].concat(),
        4 => {
            let number = *any(
                &[f32::NAN, f32::INFINITY, f32::MAX, -1.0, 1e-45, 1e30],
                random,
            );
            number.to_le_bytes().to_vec()
        }
        _ => {
            let number = *any(
                &[f64::NAN, f64::INFINITY, f64::MAX, -1.0, 1e-320, 1e30],
                random,
            );
            number.to_le_bytes().to_vec()
        }
    }
}
