//! `seedbed study script`: prints a job script that executes a study as an array of shards.

use std::path::{Path, PathBuf};

use super::arguments::{Scheduler, ScriptArgs};
use super::plans::Selection;
use crate::cli::{CliError, pluralize};
use seedbed::experiment::COST_PER_MINUTE;
use seedbed::input_files::{self, BUILTIN_FILES};
use seedbed::study::design::plan::StudyPlan;
use seedbed::study::store::StudyFolder;
use seedbed::text::shell_word;
use seedbed_env::gymnasium::named_python;

/// What a script says of its study. Words are quoted for the shell.
struct JobScript {
    name: String,
    summary: String,
    tasks: usize,
    jobs: u16,
    seedbed: String,
    study: String,
    folder: String,
    working_directory: String,
    /// `run` or `confirm`.
    action: &'static str,
    /// Options that the command had as well, such as ` --quick`.
    options: String,
}

/// Prints a script, and how to use it.
pub(super) fn print(args: &ScriptArgs) -> Result<(), CliError> {
    let selection = Selection::of_results(std::slice::from_ref(&args.study), &args.results);
    for (plan, folder) in selection.load()? {
        print_for(args, &plan, &folder)?;
    }
    Ok(())
}

fn print_for(args: &ScriptArgs, plan: &StudyPlan, folder: &StudyFolder) -> Result<(), CliError> {
    let script = JobScript::new(args, plan, folder)?;
    let text = match args.scheduler {
        Scheduler::Slurm => script.slurm(),
    };
    say!("{}", text.trim_end());
    let command: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<_> = command.iter().map(|word| shell_word(word)).collect();
    let file = format!("{}.sbatch", script.name);
    note!("{}", script.summary);
    note!(
        "submit it with: seedbed {} > {file}; sbatch {file}",
        words.join(" ")
    );
    Ok(())
}

impl JobScript {
    fn new(args: &ScriptArgs, plan: &StudyPlan, folder: &StudyFolder) -> Result<Self, CliError> {
        if input_files::is_stream(&plan.path) {
            let message =
                "a job script needs the path of a study file, not a pipe: the jobs read it";
            return Err(CliError::Usage(message.to_owned()));
        }
        let costs: Vec<f64> = plan
            .distinct_runs()
            .iter()
            .filter(|run| run.name.is_none())
            .map(|run| run.cell.source.cost())
            .collect();
        let tasks = task_count(&costs, args.max_tasks as usize);
        let executable =
            std::env::current_exe().map_err(|error| no_path("this program", &error))?;
        Ok(Self {
            name: job_name(&plan.name),
            summary: summary(&costs, tasks),
            tasks,
            jobs: args.execution.jobs.unwrap_or(1),
            seedbed: path_word(&executable)?,
            study: path_word(&plan.path)?,
            folder: path_word(folder.path())?,
            working_directory: path_word(Path::new("."))?,
            action: if args.results.registered {
                "confirm"
            } else {
                "run"
            },
            options: options(args)?,
        })
    }

    /// The script for Slurm. Its directives have no paths, which Slurm would not read as a shell does.
    fn slurm(&self) -> String {
        let Self {
            name,
            summary,
            tasks,
            jobs,
            seedbed,
            study,
            folder,
            working_directory,
            action,
            options,
        } = self;
        let last_task = tasks - 1;
        format!(
            r#"#!/bin/bash
#SBATCH --job-name={name}
#SBATCH --array=0-{last_task}
#SBATCH --cpus-per-task={jobs}
#SBATCH --requeue
#SBATCH --signal=B:TERM@60
#SBATCH --output=/dev/null
# {summary}
# Add what your cluster asks for, such as --account, --partition, --time or --mem, as further lines
# `#SBATCH` or as options of sbatch. Submit the script again to execute what is missing.

seedbed={seedbed}
study={study}
folder={folder}
logs="$folder/slurm"
report_log="$logs/${{SLURM_ARRAY_JOB_ID}}_report.out"

cd {working_directory} || exit 1
mkdir -p "$logs" || exit 1
exec >>"$logs/${{SLURM_ARRAY_JOB_ID}}_$SLURM_ARRAY_TASK_ID.out" 2>&1

# The first task submits the job that writes the report when all tasks have ended.
if [ "$SLURM_ARRAY_TASK_ID" = "${{SLURM_ARRAY_TASK_MIN:-0}}" ] && [ ! -e "$report_log" ]; then
    sbatch --job-name={name}-report --dependency="afterany:$SLURM_ARRAY_JOB_ID" \
        ${{SLURM_JOB_ACCOUNT:+--account="$SLURM_JOB_ACCOUNT"}} \
        ${{SLURM_JOB_PARTITION:+--partition="$SLURM_JOB_PARTITION"}} \
        --output="${{report_log//%/%%}}" <<'END_OF_REPORT_JOB' && : >>"$report_log" ||
#!/bin/sh
cd {working_directory} || exit 1
exec {seedbed} report {folder}
END_OF_REPORT_JOB
        echo "no job for the report was submitted: write it with \`seedbed report\` when all tasks have ended"
fi

# `exec`: Slurm signals the process of the script, which so is the program.
exec "$seedbed" study {action} "$study" --out "$folder"{options} \
    --jobs "${{SLURM_CPUS_PER_TASK:-{jobs}}}" --shard "$SLURM_ARRAY_TASK_ID/{tasks}"
"#
        )
    }
}

/// Number of tasks: at most one per run and `max_tasks`, and as few as are needed so that each has
/// about a minute of work.
fn task_count(costs: &[f64], max_tasks: usize) -> usize {
    let minutes = costs.iter().sum::<f64>() / COST_PER_MINUTE;
    (minutes as usize).min(costs.len()).min(max_tasks).max(1)
}

fn summary(costs: &[f64], tasks: usize) -> String {
    let minutes = costs.iter().sum::<f64>() / COST_PER_MINUTE / tasks as f64;
    let work = match minutes {
        minutes if minutes < 1.5 => "a minute of work or less".to_owned(),
        minutes if minutes < 90.0 => format!("up to about {minutes:.0} minutes of work"),
        minutes => format!("up to about {:.0} hours of work", minutes / 60.0),
    };
    format!(
        "{} in {}, each with {work} on one core (a rough estimate)",
        pluralize(costs.len(), "run"),
        pluralize(tasks, "task")
    )
}

/// The name of a study as the name of a job: letters, digits, `.`, `_` and `-`.
fn job_name(study: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    study
        .chars()
        .map(|c| if is_plain(c) { c } else { '_' })
        .collect()
}

/// The options of the command that its shards need as well.
fn options(args: &ScriptArgs) -> Result<String, CliError> {
    let options = [
        (args.results.place.quick, " --quick"),
        (args.execution.retry, " --retry"),
        (args.execution.ignore_memory, " --ignore-memory"),
    ];
    let given = options.iter().filter(|(is_given, _)| *is_given);
    let given: String = given.map(|(_, option)| *option).collect();
    // Machines of a cluster need not have the variables of this one.
    match named_python() {
        // A program without a folder is looked up by its name.
        Some(python) if python.components().count() == 1 => {
            let name = python.display().to_string();
            Ok(format!("{given} --python {}", shell_word(&name)))
        }
        Some(python) => Ok(format!("{given} --python {}", path_word(&python)?)),
        None => Ok(given),
    }
}

/// The absolute path as a word of a shell. A built-in file keeps its name.
fn path_word(path: &Path) -> Result<String, CliError> {
    let path: PathBuf = if is_builtin(path) {
        path.to_owned()
    } else {
        std::path::absolute(path).map_err(|error| no_path(&path.display().to_string(), &error))?
    };
    let text = path
        .to_str()
        .filter(|text| !text.contains(char::is_control));
    let text = text.ok_or_else(|| {
        CliError::Usage(format!(
            "{} has control characters or is no UTF-8; such a path cannot be in a script",
            path.display()
        ))
    })?;
    Ok(shell_word(text).into_owned())
}

fn is_builtin(path: &Path) -> bool {
    BUILTIN_FILES.iter().any(|file| file.full_path() == path)
}

fn no_path(what: &str, error: &std::io::Error) -> CliError {
    CliError::Runtime(format!("the path of {what} is not known: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_script_for_slurm() {
        let script = JobScript {
            name: job_name("größe 2"),
            summary: summary(&[COST_PER_MINUTE; 120], 40),
            tasks: 40,
            jobs: 2,
            seedbed: path_word(Path::new("/opt/seed bed/bin/seedbed")).unwrap(),
            study: path_word(Path::new("/home/o'neill/$HOME größe 2.ron")).unwrap(),
            folder: path_word(Path::new("/scratch/50%/out")).unwrap(),
            working_directory: path_word(Path::new("/home/o'neill")).unwrap(),
            action: "run",
            options: " --quick".to_owned(),
        };
        expect_test::expect_file!["script.golden.sh"].assert_eq(&script.slurm());
    }

    #[test]
    fn tasks_last_about_a_minute_and_are_limited() {
        let seconds = COST_PER_MINUTE / 60.0;
        for (costs, max_tasks, tasks) in [
            (vec![seconds; 100], 1001, 1),
            (vec![seconds; 2590], 1001, 43),
            (vec![60.0 * seconds; 2590], 1001, 1001),
            (vec![600.0 * seconds; 20], 1001, 20),
            (vec![600.0 * seconds; 20], 7, 7),
            (Vec::new(), 1001, 1),
        ] {
            assert_eq!(task_count(&costs, max_tasks), tasks);
        }
    }

    #[test]
    fn summaries_round_to_minutes_and_hours() {
        let summary = |minutes: f64| summary(&[minutes * COST_PER_MINUTE; 2], 2);
        assert!(summary(0.1).starts_with("2 runs in 2 tasks, each with a minute of work or less"));
        assert!(summary(7.2).contains("up to about 7 minutes"));
        assert!(summary(150.0).contains("up to about 2 hours"));
    }

    #[test]
    fn paths_with_control_characters_are_refused() {
        let error = path_word(Path::new("/a\nb")).unwrap_err();
        assert!(error.to_string().contains("control characters"), "{error}");
    }
}
