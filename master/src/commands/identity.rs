//! `terrawall identity create DIR`: a new cluster.
//!
//! In: a directory. Out: certificates and keys in it, and what to copy where. It never overwrites.

use crate::args::Identity;
use crate::failure::{Failure, OrConfiguration as _};
use crate::output;

/// Makes a new cluster.
pub(crate) fn run(args: Identity) -> Result<(), Failure> {
    let Identity::Create { directory } = args;
    let identity = link::Identity::create(&directory).or_configuration()?;
    output::line(format!(
        "Cluster {} is in {}. Copy ca.pem, member.pem and member.key to every host of the wall and name \
         their directory with --identity. Keep ca.key to yourself: nothing needs it to run.",
        identity.fingerprint(),
        directory.display()
    ))
}
