//! The words of the command line.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use crate::Failure;

pub(crate) const USAGE: &str = "usage: paper_scale generate SCENE RIG FIELD --light LIGHT… [--error E] [--samples N] \
    [--bounces B] [--seed S] [--size WIDTHxHEIGHT] [--pictures FOLDER]
       paper_scale time FIELD --light LIGHT… [--repeat N] [--brief]
       paper_scale disk FIELD --light LIGHT [--repeat N]
       paper_scale dense FIELD FOLDER --light LIGHT…";

/// Options that take a value.
const OPTIONS: [&str; 7] = ["--error", "--samples", "--bounces", "--seed", "--size", "--pictures", "--repeat"];

/// What was given after the command.
#[derive(Default)]
pub(crate) struct Words {
    paths: Vec<PathBuf>,
    pub(crate) lights: Vec<PathBuf>,
    options: BTreeMap<String, String>,
    pub(crate) brief: bool,
}

impl Words {
    pub(crate) fn parse(arguments: impl Iterator<Item = String>) -> Result<Self, Failure> {
        let mut words = Self::default();
        let mut arguments = arguments.peekable();
        while let Some(argument) = arguments.next() {
            match argument.as_str() {
                "--brief" => words.brief = true,
                "--light" => {
                    while let Some(light) = arguments.next_if(|argument| !argument.starts_with("--")) {
                        words.lights.push(light.into());
                    }
                }
                option if OPTIONS.contains(&option) => {
                    words.options.insert(argument, arguments.next().ok_or(USAGE)?);
                }
                _ if argument.starts_with("--") => return Err(USAGE.into()),
                _ => words.paths.push(argument.into()),
            }
        }
        if words.lights.is_empty() { Err(USAGE.into()) } else { Ok(words) }
    }

    /// The paths, if they are so many.
    pub(crate) fn paths<const N: usize>(&self) -> Result<[&Path; N], Failure> {
        let paths: Vec<&Path> = self.paths.iter().map(PathBuf::as_path).collect();
        paths.try_into().map_err(|_| USAGE.into())
    }

    /// The value of an option, if it was given.
    pub(crate) fn option<T: FromStr>(&self, name: &str) -> Result<Option<T>, Failure> {
        let parse = |text: &String| text.parse().map_err(|_| format!("{name}: \"{text}\" cannot be").into());
        self.options.get(name).map(parse).transpose()
    }
}
