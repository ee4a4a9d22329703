//! A sweep as a job array of Slurm.

use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::cli::Verdict;
use crate::host;

/// A text as one word of a shell.
fn word(text: &str) -> String {
    format!("'{}'", text.replace('\'', "'\\''"))
}

/// The script of an array: each task runs one shard.
fn script(program: &str, here: &str, folder: &str, tasks: u32, options: &[String]) -> String {
    let options: String = options.iter().map(|option| format!(" {}", word(option))).collect();
    format!(
        "#!/bin/sh\n#SBATCH --job-name=fillrate\n#SBATCH --array=1-{tasks}\n#SBATCH --output=/dev/null\ncd {} || exit 1\n\
         exec {} sweep {} --out {} --shard \"$SLURM_ARRAY_TASK_ID/{tasks}\"{options} > {}-\"$SLURM_ARRAY_TASK_ID\".log 2>&1\n",
        word(here),
        word(program),
        word(&format!("{folder}/experiment.ron")),
        word(folder),
        word(&format!("{folder}/slurm")),
    )
}

/// Gives a job to Slurm; its number.
fn sbatch(arguments: &[&str]) -> Result<String> {
    let done = Command::new("sbatch").arg("--parsable").args(arguments).output();
    let done = done.context("cannot start sbatch; is Slurm installed on this host? (--shard I/N runs a part by itself)")?;
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
    if !done.status.success() {
        bail!("sbatch refused the job: {}", text(&done.stderr));
    }
    // The number, and behind a semicolon the cluster.
    Ok(text(&done.stdout).split(';').next().unwrap_or_default().to_owned())
}

/// Submits the shards of a folder that has been begun, and a job that merges them when all have ended well.
///
/// # Errors
/// If the script cannot be written, or Slurm does not take a job.
pub fn submit(out: &Path, tasks: u32, options: &[String], yes: bool) -> Result<Verdict> {
    let absolute = |path: &Path| {
        let path = path.canonicalize().with_context(|| format!("cannot find {}", path.display()))?;
        path.into_os_string().into_string().map_err(|path| anyhow::anyhow!("{} is no UTF-8", path.display()))
    };
    let (program, here, folder) = (absolute(&std::env::current_exe()?)?, absolute(Path::new("."))?, absolute(out)?);
    let mut options = options.to_vec();
    options.extend(yes.then(|| "--yes".to_owned()));
    let path = out.join("slurm.sh");
    let text = script(&program, &here, &folder, tasks, &options);
    host::write_file(&path, text.as_bytes()).with_context(|| format!("cannot write {}", path.display()))?;
    let array = sbatch(&[&path.display().to_string()])?;
    let merge = format!(
        "cd {} && exec {} sweep merge {} > {} 2>&1",
        word(&here),
        word(&program),
        word(&folder),
        word(&format!("{folder}/merge.log"))
    );
    let merge = sbatch(&[
        "--job-name=fillrate-merge",
        "--output=/dev/null",
        &format!("--dependency=afterok:{array}"),
        &format!("--wrap={merge}"),
    ])?;
    println!(
        "job array {array} runs {tasks} shards (slurm-TASK.log); job {merge} merges them into {} (merge.log)",
        out.display()
    );
    Ok(Verdict::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_are_safe_in_a_shell() {
        let text = script("/opt/fill rate", "/home/a'b", "/shared/$x", 4, &["--limit".into(), "work.steps=1".into()]);
        assert!(text.contains("cd '/home/a'\\''b' || exit 1\n"), "{text}");
        let line = "exec '/opt/fill rate' sweep '/shared/$x/experiment.ron' --out '/shared/$x' \
                    --shard \"$SLURM_ARRAY_TASK_ID/4\" '--limit' 'work.steps=1' > '/shared/$x/slurm'-\"$SLURM_ARRAY_TASK_ID\".log 2>&1\n";
        assert!(text.ends_with(line), "{text}");
    }
}
