//! `cfpose pose convert`: poses from one text form to another.

use cfpose_vision::{PoseFormat, read_poses};

use crate::args::{PoseArgs, PoseCommand, PoseTarget};
use crate::failure::Failure;
use crate::output;

/// Run the command.
///
/// # Errors
/// [`Failure`] for a file that holds no poses.
pub fn run(args: &PoseArgs) -> Result<(), Failure> {
    let PoseCommand::Convert { file, to } = &args.command;
    let format = match to {
        PoseTarget::Matrix => PoseFormat::Matrix,
        PoseTarget::Tum => PoseFormat::Tum,
        PoseTarget::Kitti => PoseFormat::Kitti,
        PoseTarget::Json => PoseFormat::Json,
    };
    output::print(format.write(&read_poses(file)?).trim_end())
}
