//! Talk on stderr: remarks, and a bar with what is left.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

/// Whether anything is said.
pub(crate) struct Talk {
    quiet: bool,
}

impl Talk {
    pub(crate) fn new(quiet: bool) -> Self {
        Self { quiet }
    }

    /// One line.
    pub(crate) fn say(&self, line: impl AsRef<str>) {
        if !self.quiet {
            eprintln!("{}", line.as_ref());
        }
    }

    /// The first few of many lines, and how many more there are.
    pub(crate) fn say_some(&self, lines: &[String], most: usize) {
        lines.iter().take(most).for_each(|line| self.say(format!("  {line}")));
        if lines.len() > most {
            self.say(format!("  … and {} more", lines.len() - most));
        }
    }

    /// Photographs that could not be used.
    pub(crate) fn say_losses(&self, losses: &[String]) {
        self.say("photographs that could not be used:");
        self.say_some(losses, 20);
    }

    /// A bar of `steps`, `done` of them done already; invisible when quiet or when stderr is no terminal.
    pub(crate) fn bar(&self, what: &str, steps: usize, done: usize) -> ProgressBar {
        if self.quiet {
            return ProgressBar::hidden();
        }
        let bar = ProgressBar::new(steps as u64).with_position(done as u64);
        let style = ProgressStyle::with_template("{msg} {bar:32} {pos}/{len}, {eta} left");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
        bar.set_message(what.to_string());
        bar.reset_eta();
        bar.enable_steady_tick(Duration::from_millis(250));
        bar
    }
}
