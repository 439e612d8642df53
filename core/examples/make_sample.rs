//! Writes the files of the embedded sample: `cargo run -p glioscope-core --example make_sample --
//! data-samples`. Run it from the workspace's root after changing the phantom, and commit the
//! files.

use std::error::Error;
use std::io::Write;
use std::path::PathBuf;

use flate2::{Compression, GzBuilder};
use glioscope_core::{case, files, files::Source, phantom};

fn main() -> Result<(), Box<dyn Error>> {
    let folder: PathBuf = std::env::args_os().nth(1).ok_or("usage: make_sample FOLDER")?.into();
    std::fs::create_dir_all(&folder)?;
    let mut total = 0;
    for file in phantom::phantom() {
        // Best compression: every byte is embedded in the program.
        let mut encoder = GzBuilder::new().mtime(0).write(Vec::new(), Compression::best());
        encoder.write_all(&files::nifti_bytes(&file.volume, false))?;
        let bytes = encoder.finish()?;
        total += bytes.len();
        files::write_whole(&folder.join(file.name), &bytes)?;
    }
    let spec = phantom::spec(|name| Source::File(folder.join(name)));
    files::write_whole(&folder.join("case.toml"), case::write_manifest(&spec, &folder)?.as_bytes())?;
    let truth = serde_json::to_string_pretty(&phantom::truth())? + "\n";
    files::write_whole(&folder.join("truth.json"), truth.as_bytes())?;
    writeln!(std::io::stdout(), "{total} bytes of images and masks in {}", folder.display())?;
    Ok(())
}
