//! The person at the rig: told what to do, answers with Enter, or with q to stop.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::io::{BufRead, Write};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::thread;

use crate::RigError;

/// What becomes of lines that are typed while nothing is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TypedEarly {
    /// They are forgotten, all but q: at a terminal, an Enter too many must not answer a question nobody has read.
    Forget,
    /// They answer the next questions: a script writes all its answers at once.
    Keep,
}

/// The person at the rig.
pub struct Operator {
    lines: RefCell<Lines>,
    output: RefCell<Box<dyn Write>>,
    typed_early: TypedEarly,
}

struct Lines {
    input: Receiver<String>,
    typed: VecDeque<String>,
    ended: bool,
}

impl Operator {
    /// Talks on `output` and listens to `input`. A thread waits for lines, so that q is heard also while the camera is
    /// waited for; it ends with the input.
    ///
    /// # Errors
    /// If there is no thread to be had.
    pub fn new(
        input: impl BufRead + Send + 'static,
        output: impl Write + 'static,
        typed_early: TypedEarly,
    ) -> Result<Self, RigError> {
        let (sender, receiver) = channel();
        let listen = move || {
            // What is no text ends the talk as the end of the input does.
            for line in input.lines().map_while(Result::ok) {
                if sender.send(line.trim().to_lowercase()).is_err() {
                    return;
                }
            }
        };
        thread::Builder::new().name("operator".into()).spawn(listen).map_err(|error| RigError::Device {
            device: "operator",
            reason: format!("cannot listen to the keyboard: {error}"),
        })?;
        let lines = Lines { input: receiver, typed: VecDeque::new(), ended: false };
        Ok(Self { lines: RefCell::new(lines), output: RefCell::new(Box::new(output)), typed_early })
    }

    /// Says one line.
    ///
    /// # Errors
    /// [`RigError::Stopped`] if nobody can hear it.
    pub fn say(&self, line: &str) -> Result<(), RigError> {
        let mut output = self.output.borrow_mut();
        writeln!(output, "{line}").and_then(|()| output.flush()).map_err(|_| RigError::Stopped)
    }

    /// Asks to do something, and waits for Enter.
    ///
    /// # Errors
    /// [`RigError::Stopped`] for q and at the end of the input.
    pub fn ask(&self, what: &str) -> Result<(), RigError> {
        if self.wants_to_stop() {
            return Err(RigError::Stopped);
        }
        self.say(&format!("{what}; then press Enter (q and Enter to stop)"))?;
        loop {
            let answer = self.lines.borrow_mut().next();
            match answer.as_deref() {
                None | Some("q" | "quit") => return Err(RigError::Stopped),
                Some("") => return Ok(()),
                Some(other) => {
                    self.say(&format!("\"{other}\" is no answer: press Enter when it is done, q to stop"))?;
                }
            }
        }
    }

    /// Whether q was typed while nothing was asked, or the input has ended. Never waits.
    pub fn wants_to_stop(&self) -> bool {
        let mut lines = self.lines.borrow_mut();
        lines.hear();
        match self.typed_early {
            TypedEarly::Forget => {
                let stop = lines.typed.iter().any(|line| line == "q" || line == "quit");
                lines.typed.clear();
                stop || lines.ended
            }
            TypedEarly::Keep => match lines.typed.front() {
                Some(line) => line == "q" || line == "quit",
                None => lines.ended,
            },
        }
    }
}

impl Lines {
    /// Takes in what has been typed.
    fn hear(&mut self) {
        loop {
            match self.input.try_recv() {
                Ok(line) => self.typed.push_back(line),
                Err(TryRecvError::Empty) => return,
                Err(TryRecvError::Disconnected) => {
                    self.ended = true;
                    return;
                }
            }
        }
    }

    /// The next line, waited for; `None` at the end of the input.
    fn next(&mut self) -> Option<String> {
        self.typed.pop_front().or_else(|| self.input.recv().ok())
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::io::{self, Cursor};
    use std::sync::{Arc, Mutex};

    use super::*;

    /// What was said.
    #[derive(Clone, Default)]
    pub(crate) struct Said(Arc<Mutex<Vec<u8>>>);

    impl Said {
        pub(crate) fn text(&self) -> String {
            String::from_utf8(self.0.lock().unwrap().clone()).unwrap()
        }
    }

    impl Write for Said {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            self.0.lock().unwrap().write(bytes)
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    pub(crate) fn scripted(answers: &'static str) -> (Operator, Said) {
        let said = Said::default();
        (Operator::new(Cursor::new(answers), said.clone(), TypedEarly::Keep).unwrap(), said)
    }

    #[test]
    fn enter_goes_on_nonsense_is_asked_again_q_stops() {
        let (operator, said) = scripted("\nyes\n  \n Q \n\n");
        operator.ask("move").unwrap();
        operator.ask("show").unwrap();
        assert!(matches!(operator.ask("focus"), Err(RigError::Stopped)));
        let text = said.text();
        assert!(text.contains("move; then press Enter") && text.contains("\"yes\" is no answer"), "{text}");
    }

    #[test]
    fn the_end_of_the_input_stops() {
        let (operator, _) = scripted("");
        assert!(matches!(operator.ask("move"), Err(RigError::Stopped)));
    }

    #[test]
    fn at_a_terminal_an_early_enter_answers_nothing() {
        let (reader, mut writer) = io::pipe().unwrap();
        let said = Said::default();
        let operator = Operator::new(io::BufReader::new(reader), said.clone(), TypedEarly::Forget).unwrap();
        writer.write_all(b"\n\n").unwrap();
        thread::sleep(std::time::Duration::from_millis(100));
        assert!(!operator.wants_to_stop());
        let late = thread::spawn(move || {
            thread::sleep(std::time::Duration::from_millis(100));
            writer.write_all(b"no\n\n").unwrap();
            writer
        });
        operator.ask("move").unwrap();
        assert!(said.text().contains("\"no\" is no answer"), "the early Enter was taken: {}", said.text());
        let mut writer = late.join().unwrap();
        writer.write_all(b"q\n").unwrap();
        thread::sleep(std::time::Duration::from_millis(100));
        assert!(operator.wants_to_stop());
    }
}
