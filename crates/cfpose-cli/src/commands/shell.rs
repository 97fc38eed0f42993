//! `cfpose completions` and `cfpose man`: made from the definitions that read the command line.

use std::io::Write;
use std::path::Path;

use crate::args::{CompletionsArgs, ManArgs, command, program};
use crate::failure::Failure;
use crate::output;

/// Write the completions of a shell.
///
/// # Errors
/// [`Failure`] of standard output.
pub fn completions(args: &CompletionsArgs) -> Result<(), Failure> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command(), program(), &mut script);
    Ok(std::io::stdout().lock().write_all(&script)?)
}

/// Write the manual.
///
/// # Errors
/// [`Failure`] of the folder or of standard output.
pub fn man(args: &ManArgs) -> Result<(), Failure> {
    let mut command = command();
    command.build();
    let Some(out) = &args.out else {
        let mut page = Vec::new();
        clap_mangen::Man::new(command).render(&mut page)?;
        return Ok(std::io::stdout().lock().write_all(&page)?);
    };
    let fail = |error: std::io::Error| Failure::input(format!("{}: {error}", out.display()));
    std::fs::create_dir_all(out).map_err(fail)?;
    let count = pages(&command, &program(), out)?;
    output::print(&format!("{count} pages in {}; read them with man -l", out.display()))
}

/// Write the page of a command and those of its sub-commands; returns how many.
fn pages(command: &clap::Command, name: &str, out: &Path) -> Result<usize, Failure> {
    let mut page = Vec::new();
    // The page names the command as it is called: `cfpose pose convert`.
    let own = command.clone().name(name.replace(' ', "-")).display_name(name.replace(' ', "-"));
    clap_mangen::Man::new(own).render(&mut page)?;
    let path = out.join(format!("{}.1", name.replace(' ', "-")));
    std::fs::write(&path, page).map_err(|error| Failure::input(format!("{}: {error}", path.display())))?;
    let mut count = 1;
    for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help") {
        count += pages(inner, &format!("{name} {}", inner.get_name()), out)?;
    }
    Ok(count)
}
