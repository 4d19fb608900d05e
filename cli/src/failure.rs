//! How a command ends when it does not end well.

use std::io;
use std::process::ExitCode;

use relumine::Error;

/// What goes to stderr, and the exit code.
pub(crate) struct Failure {
    message: String,
    hint: Option<String>,
    code: u8,
}

impl Failure {
    /// The job failed: exit code 1.
    pub(crate) fn failed(message: impl Into<String>) -> Self {
        Self { message: message.into(), hint: None, code: 1 }
    }

    /// The words of the command contradict themselves: exit code 2.
    pub(crate) fn usage(message: impl Into<String>) -> Self {
        Self { message: message.into(), hint: Some("see `relumine help`".into()), code: 2 }
    }

    /// The input is damaged or incomplete: exit code 3.
    pub(crate) fn incomplete(message: impl Into<String>) -> Self {
        Self { message: message.into(), hint: None, code: 3 }
    }

    pub(crate) fn with_hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Says it.
    pub(crate) fn report(self) -> ExitCode {
        eprintln!("error: {}", self.message);
        if let Some(hint) = self.hint {
            eprintln!("  help: {hint}");
        }
        ExitCode::from(self.code)
    }
}

impl<E: Into<Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        let error = error.into();
        Self {
            message: error.to_string(),
            hint: error.hint().map(Into::into),
            code: if error.is_damaged_input() { 3 } else { 1 },
        }
    }
}

/// Printing to a pipe whose reader has gone is no error worth a word; anything else is.
pub(crate) fn printed(result: io::Result<()>) -> Result<(), Failure> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(Failure::failed(format!("cannot print: {error}")))
        }
        _ => Ok(()),
    }
}
