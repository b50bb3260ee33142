//! `terrawall cache stat`: what is in a disk cache.
//!
//! In: directories; scenes and repositories that tell whose groups these are. Out: a table for each directory, or JSON.
//! It must not change anything.

use std::path::PathBuf;

use node::cache::{self, Files, Group, Statistics};
use serde::Serialize;

use crate::args::StatCache;
use crate::failure::Failure;
use crate::output;

use super::super::files;
use super::{directories, megabytes, refused};

/// A directory, as the report has it.
#[derive(Debug, Serialize)]
struct Report {
    directory: PathBuf,
    files: u64,
    bytes: u64,
    /// The smallest budget of the processes that use it; none where no process does.
    budget_bytes: Option<u64>,
    processes: u64,
    leases: u64,
    unfinished_files: u64,
    unfinished_bytes: u64,
    foreign_files: u64,
    groups: Vec<GroupReport>,
}

#[derive(Debug, Serialize)]
struct GroupReport {
    group: String,
    /// None where no scene and no repository told.
    data_set: Option<String>,
    /// False for groups of imports that later ones have replaced; none where the data set is unknown.
    current: Option<bool>,
    files: u64,
    bytes: u64,
}

/// Tells.
pub(super) fn run(args: &StatCache) -> Result<(), Failure> {
    let directories = directories(&args.places)?;
    let groups = groups(args)?;
    let mut reports = Vec::with_capacity(directories.len());
    for directory in directories {
        let statistics = cache::statistics(&directory).map_err(refused)?;
        reports.push(Report::new(directory, &statistics, &groups));
    }
    if args.json {
        return output::json(&reports);
    }
    reports.iter().try_for_each(print)
}

/// The data sets that the arguments name. One that cannot be opened only stays without a name.
fn groups(args: &StatCache) -> Result<Vec<Group>, Failure> {
    let mut places = args.repository.clone();
    if let Some(scene) = &args.scene {
        let layers = files::scene(scene)?.layers.into_iter();
        places.extend(layers.filter_map(|layer| layer.repository.map(PathBuf::from)));
    }
    places.sort();
    places.dedup();
    let mut groups = Vec::new();
    for place in &places {
        match cache::group(place) {
            Ok(group) => groups.push(group),
            Err(problem) => eprintln!("terrawall: its groups stay without a name: {problem}"),
        }
    }
    Ok(groups)
}

impl Report {
    fn new(directory: PathBuf, statistics: &Statistics, known: &[Group]) -> Self {
        let of_group = |(group, files): (&String, &Files)| {
            // The id, a hyphen, the revision.
            let (id, revision) = group.rsplit_once('-').unwrap_or((group, ""));
            let owner = known.iter().find(|known| known.id == id);
            GroupReport {
                group: group.clone(),
                data_set: owner.map(|owner| owner.name.clone()),
                current: owner.map(|owner| owner.revision.to_string() == revision),
                files: files.files,
                bytes: files.bytes,
            }
        };
        Self {
            directory,
            files: statistics.all.files,
            bytes: statistics.all.bytes,
            budget_bytes: statistics.budget_bytes,
            processes: statistics.processes,
            leases: statistics.leases,
            unfinished_files: statistics.parts.files,
            unfinished_bytes: statistics.parts.bytes,
            foreign_files: statistics.foreign,
            groups: statistics.groups.iter().map(of_group).collect(),
        }
    }
}

fn print(report: &Report) -> Result<(), Failure> {
    let row = |name: String, files: u64, bytes: u64| {
        let share = format!("{:.2}", bytes as f64 / 1e6);
        vec![format!("  {name}"), files.to_string(), share]
    };
    output::line(report.directory.display())?;
    let mut rows: Vec<Vec<String>> = report
        .groups
        .iter()
        .map(|group| row(group.title(), group.files, group.bytes))
        .collect();
    rows.push(row("all".to_owned(), report.files, report.bytes));
    output::table(&["  data set", "files", "MB"], &rows)?;
    output::line(match report.budget_bytes {
        Some(bytes) => format!(
            "  used by {} processes with a budget of {}",
            report.processes,
            megabytes(bytes)
        ),
        None => "  used by no process".to_owned(),
    })?;
    output::line(format!(
        "  {} unfinished files ({}), {} tiles being fetched, {} foreign files",
        report.unfinished_files,
        megabytes(report.unfinished_bytes),
        report.leases,
        report.foreign_files
    ))
}

impl GroupReport {
    fn title(&self) -> String {
        match (&self.data_set, self.current) {
            (Some(name), Some(false)) => {
                format!("\"{name}\" before its last import ({})", self.group)
            }
            (Some(name), _) => format!("\"{name}\" ({})", self.group),
            (None, _) => self.group.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(
        clippy::unwrap_used,
        clippy::indexing_slicing,
        reason = "a test that panics has failed"
    )]
    use super::*;

    #[test]
    fn groups_are_named_by_their_data_sets() {
        let files = Files { files: 2, bytes: 9 };
        let statistics = Statistics {
            groups: ["aa-3", "aa-2", "bb-3", "odd"]
                .map(|group| (group.to_owned(), files))
                .into(),
            ..Statistics::default()
        };
        let known = Group {
            id: "aa".to_owned(),
            revision: 3,
            name: "relief".to_owned(),
        };
        let report = Report::new(PathBuf::from("d"), &statistics, &[known]);
        let titles: Vec<String> = report.groups.iter().map(GroupReport::title).collect();
        assert_eq!(
            titles,
            [
                "\"relief\" before its last import (aa-2)",
                "\"relief\" (aa-3)",
                "bb-3",
                "odd"
            ]
        );
        let current: Vec<_> = report.groups.iter().map(|group| group.current).collect();
        assert_eq!(current, [Some(false), Some(true), None, None]);
    }
}
