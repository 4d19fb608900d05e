//! Ways to spoil a valid text, for the `any_input` tests of the readers: what slips of the hand, torn files and lies look
//! like. Fuzzing finds more, but takes longer.

use proptest::collection::vec;
use proptest::prelude::*;
use proptest::sample::{Index, select};

/// Put in the place of a number.
const EXTREMES: [&str; 22] = [
    "0",
    "-0",
    "-1",
    "1",
    "0.5",
    "1e308",
    "-1e308",
    "1e309",
    "1e-160",
    "1e-308",
    "nan",
    "inf",
    "-inf",
    "65536",
    "65537",
    "9223372036854775807",
    "18446744073709551615",
    "18446744073709551616",
    "0x10",
    "\"a\"",
    "[]",
    "",
];

/// What the tests are run with: the same cases every time.
pub(crate) fn seeded(cases: u32) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: proptest::test_runner::RngSeed::Fixed(2003),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

#[derive(Clone, Debug)]
enum Edit {
    DeleteBytes(Index, usize),
    DeleteLine(Index),
    RepeatLine(Index, Index),
    ReplaceByte(Index, u8),
    ReplaceNumber(Index, &'static str),
    LongNumber(Index),
    LongWord(Index),
    Truncate(Index),
}

fn edit() -> impl Strategy<Value = Edit> {
    let place = any::<Index>;
    prop_oneof![
        2 => (place(), 1..20_usize).prop_map(|(at, count)| Edit::DeleteBytes(at, count)),
        2 => place().prop_map(Edit::DeleteLine),
        2 => (place(), place()).prop_map(|(from, to)| Edit::RepeatLine(from, to)),
        2 => (place(), any::<u8>()).prop_map(|(at, byte)| Edit::ReplaceByte(at, byte)),
        8 => (place(), select(&EXTREMES)).prop_map(|(which, number)| Edit::ReplaceNumber(which, number)),
        1 => place().prop_map(Edit::LongNumber),
        1 => place().prop_map(Edit::LongWord),
        1 => place().prop_map(Edit::Truncate),
    ]
}

/// One of the texts with one to three edits.
pub(crate) fn spoiled(texts: &'static [&'static str]) -> impl Strategy<Value = Vec<u8>> {
    (select(texts), vec(edit(), 1..4)).prop_map(|(text, edits)| {
        let mut bytes = text.as_bytes().to_vec();
        for edit in &edits {
            if !bytes.is_empty() {
                apply(edit, &mut bytes);
            }
        }
        bytes
    })
}

/// As [`spoiled`], for readers of text.
pub(crate) fn spoiled_text(texts: &'static [&'static str]) -> impl Strategy<Value = String> {
    spoiled(texts).prop_map(|bytes| String::from_utf8_lossy(&bytes).into_owned())
}

fn apply(edit: &Edit, bytes: &mut Vec<u8>) {
    match edit {
        Edit::DeleteBytes(at, count) => {
            let at = at.index(bytes.len());
            bytes.drain(at..(at + count).min(bytes.len()));
        }
        Edit::DeleteLine(which) => {
            let mut lines = lines(bytes);
            lines.remove(which.index(lines.len()));
            *bytes = lines.concat();
        }
        Edit::RepeatLine(from, to) => {
            let mut lines = lines(bytes);
            let line = lines[from.index(lines.len())].clone();
            lines.insert(to.index(lines.len()), line);
            *bytes = lines.concat();
        }
        Edit::ReplaceByte(at, byte) => {
            let at = at.index(bytes.len());
            bytes[at] = *byte;
        }
        Edit::ReplaceNumber(which, number) => replace_number(which, number, bytes),
        Edit::LongNumber(which) => replace_number(which, &"9".repeat(5_000), bytes),
        Edit::LongWord(at) => {
            let at = at.index(bytes.len());
            bytes.splice(at..at, b"x".repeat(70_000));
        }
        Edit::Truncate(at) => bytes.truncate(at.index(bytes.len())),
    }
}

/// Each with its newline.
fn lines(bytes: &[u8]) -> Vec<Vec<u8>> {
    bytes.split_inclusive(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect()
}

fn replace_number(which: &Index, number: &str, bytes: &mut Vec<u8>) {
    let in_number = |at: usize| bytes[at].is_ascii_digit() || b"+-.".contains(&bytes[at]);
    let starts: Vec<usize> = (0..bytes.len()).filter(|at| in_number(*at) && (*at == 0 || !in_number(at - 1))).collect();
    if starts.is_empty() {
        return;
    }
    let start = starts[which.index(starts.len())];
    let end = (start..bytes.len()).find(|at| !in_number(*at)).unwrap_or(bytes.len());
    bytes.splice(start..end, number.bytes());
}
