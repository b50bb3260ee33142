//! An import from beginning to end.
//! In: options. Out: a repository that holds the sources, and a report. Sources that share spacing and coordinate system
//! form one pass at one level, the coarsest first; each pass is published by itself. Memory is bounded by the
//! options whatever the sources' size; a killed import is continued by the next run with the same options.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

use geodesy::{Direction, Tile};
use rayon::ThreadPool;
use tiles::{Dataset, Index, Repository, SourceNote};

use crate::describe::describe;
use crate::error::ImportError;
use crate::level::{Spacing, tile_estimate, touched};
use crate::lock::Lock;
use crate::lru::Lru;
use crate::options::ImportOptions;
use crate::pass::{Pass, Recipe};
use crate::progress::Progress;
use crate::report::{ImportReport, Stopwatch};
use crate::resample::Resampler;
use crate::source::{self, ChunkCache, Source};
use crate::staging::{Publication, Staging, open_repository};

/// More tiles than this are no import but a mistake.
const MOST_TILES: f64 = 5e7;
const LEAST_MEMORY_BYTES: u64 = 64 << 20;
/// Imports the sources. `progress` hears how it goes; setting `cancel` ends it soon, to be continued later.
pub fn import(
    options: &ImportOptions,
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> Result<ImportReport, ImportError> {
    let began = Instant::now();
    let stopwatch = Stopwatch::start();
    check(options)?;
    let mut sources = Vec::new();
    for path in &options.sources {
        sources.extend(source::open(path, options)?);
    }
    let made_directory = !options.into.exists();
    std::fs::create_dir_all(&options.into)
        .map_err(|error| ImportError::io(&options.into, "make the directory", error))?;
    let lock = Lock::take(&options.into)?;
    let result = run(options, &sources, progress, cancel);
    drop(lock);
    if result.is_err() && made_directory {
        // Only succeeds where nothing is left that could be continued.
        let _ = std::fs::remove_dir(&options.into);
    }
    let mut report = result?;
    report.measured(began.elapsed().as_secs_f64(), stopwatch.cpu_s());
    Ok(report)
}

fn check(options: &ImportOptions) -> Result<(), ImportError> {
    let wrong = |problem: String| Err(ImportError::Options(problem));
    if options.sources.is_empty() {
        return wrong("no source was named: give at least one file to import.".to_owned());
    }
    if options.memory_bytes < LEAST_MEMORY_BYTES {
        return wrong("an import needs at least 64 MiB of memory: give it more.".to_owned());
    }
    if let Some(level) = options.level
        && level > geodesy::MAX_LEVEL
    {
        return wrong(format!(
            "level {level} is deeper than {}: choose a lower one.",
            geodesy::MAX_LEVEL
        ));
    }
    if let Some(quantum) = options.quantum_m {
        let power = quantum.is_finite() && quantum > 0.0 && quantum.log2().fract() == 0.0;
        if !power {
            return wrong(format!(
                "a quantum of {quantum} m is no power of two: write 0.0625 or the like."
            ));
        }
    }
    if let Some([low, high]) = options.range
        && !(low.is_finite() && high.is_finite() && low != high)
    {
        return wrong(format!(
            "the range {low},{high} is empty: give two different numbers."
        ));
    }
    Ok(())
}

fn run(
    options: &ImportOptions,
    sources: &[Source],
    progress: &dyn Progress,
    cancel: &AtomicBool,
) -> Result<ImportReport, ImportError> {
    let spacings: Vec<Spacing> = sources
        .iter()
        .map(|source| Spacing::of(source.grid(), &options.planet))
        .collect();
    let sets = sets_of(options, sources, &spacings);
    check_size(sources, &spacings, &sets)?;
    let describe = |existing: Option<&Dataset>| describe(options, sources, existing, progress);
    let mut staging = Staging::open(options, describe, progress)?;
    let mut report = ImportReport::new(&options.into, sources, staging.resumed);
    let mut pool = rayon::ThreadPoolBuilder::new().thread_name(|n| format!("import {n}"));
    if let Some(threads) = options.threads {
        pool = pool.num_threads(threads.max(1));
    }
    let pool = pool
        .build()
        .map_err(|error| ImportError::Options(format!("threads cannot be started: {error}.")))?;
    let context = Context {
        options,
        sources,
        spacings: &spacings,
        progress,
        cancel,
        pool: &pool,
    };
    for (number, set) in sets.iter().enumerate().skip(staging.pass()) {
        let result = context.run_set(number, set, &mut staging, &mut report);
        if let Err(error) = result {
            if matches!(error, ImportError::Source(_) | ImportError::Options(_)) {
                // The same sources would fail again: nothing is left to continue.
                staging.remove()?;
            }
            return Err(error);
        }
    }
    staging.remove()?;
    report.close();
    Ok(report)
}

/// Sources that are imported together.
struct Set {
    members: Vec<usize>,
    /// The level at which nothing is lost.
    natural_level: u8,
    /// The level that is kept.
    level: u8,
}

/// Sources of the same coordinate system and spacing belong together. Coarse sets come first, so that finer ones
/// find something to fill their holes with.
fn sets_of(options: &ImportOptions, sources: &[Source], spacings: &[Spacing]) -> Vec<Set> {
    let mut groups: Vec<(String, Spacing, Vec<usize>)> = Vec::new();
    for (number, (source, spacing)) in sources.iter().zip(spacings).enumerate() {
        let to_crs = source.grid().to_crs();
        let key = format!(
            "{} {:.4e} {:.4e} {:.4e} {:.4e}",
            source.grid().crs.name(),
            to_crs.dx_column,
            to_crs.dx_row,
            to_crs.dy_column,
            to_crs.dy_row
        );
        match groups.iter_mut().find(|(known, ..)| *known == key) {
            Some((_, joined, members)) => {
                *joined = joined.joined(*spacing);
                members.push(number);
            }
            None => groups.push((key, *spacing, vec![number])),
        }
    }
    let mut sets: Vec<Set> = groups
        .into_iter()
        .map(|(_, spacing, members)| {
            let natural = spacing.level();
            let level = options.level.unwrap_or(natural);
            Set {
                members,
                natural_level: natural.max(level),
                level,
            }
        })
        .collect();
    sets.sort_by_key(|set| (set.level, set.members.first().copied()));
    sets
}

fn check_size(sources: &[Source], spacings: &[Spacing], sets: &[Set]) -> Result<(), ImportError> {
    for set in sets {
        let estimate = |member: &usize| match (sources.get(*member), spacings.get(*member)) {
            (Some(source), Some(spacing)) => {
                tile_estimate(source.grid(), *spacing, set.natural_level)
            }
            _ => 0.0,
        };
        let tiles: f64 = set.members.iter().map(estimate).sum();
        if tiles > MOST_TILES {
            return Err(ImportError::Options(format!(
                "level {} would take about {tiles:.0} tiles: choose a coarser level or import in parts.",
                set.natural_level
            )));
        }
    }
    Ok(())
}

struct Context<'import> {
    options: &'import ImportOptions,
    sources: &'import [Source],
    spacings: &'import [Spacing],
    progress: &'import dyn Progress,
    cancel: &'import AtomicBool,
    pool: &'import ThreadPool,
}

impl Context<'_> {
    fn run_set(
        &self,
        number: usize,
        set: &Set,
        staging: &mut Staging,
        report: &mut ImportReport,
    ) -> Result<(), ImportError> {
        let repository = open_repository(&self.options.into)?;
        let index = match &repository {
            Some(repository) => load_index(repository, &self.options.into)?,
            None => Index::new(),
        };
        let dataset = staging.dataset().clone();
        let (staged, finer) = staging.stores()?;
        let cache = ChunkCache::new(self.options.memory_bytes / 2);
        let resampler = Resampler {
            sources: self.sources,
            cache: &cache,
            kind: dataset.kind,
            quantum: dataset.unit(),
            channels: usize::from(dataset.channels),
        };
        let mut pass = Pass {
            resampler,
            old: repository.as_ref().map(|repository| (repository, &index)),
            staged,
            finer,
            level: set.level,
            sample_type: dataset.sample_type,
            made: Mutex::default(),
            tiles: Lru::new(self.options.memory_bytes / 8 * 3),
            filling: false,
        };
        self.take_over(&pass)?;
        let mut changed = self.resample(&pass, set)?;
        cache.clear();
        let mut level = set.natural_level;
        while level > 0 {
            level -= 1;
            changed = self.coarsen(&pass, level, &changed)?;
        }
        let touched = pass.made_at(set.level);
        pass.filling = true;
        self.fill_finer(&pass, &index, touched)?;
        let made = pass
            .made
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        let kept = |tile: Tile| tile.level() <= set.level || index.contains(tile);
        let mut after = index.clone();
        for (tile, made) in made.iter().filter(|(tile, _)| kept(**tile)) {
            after.insert(*tile, made.lowest, made.highest);
            report.count(tile.level(), made.bytes);
        }
        if after.is_empty() {
            return Err(ImportError::Options(
                "the sources hold no data: every sample is void or outside the level's lattice. Check the no-data value."
                    .to_owned(),
            ));
        }
        report.levels_done(set.level);
        if made.is_empty() {
            let name = self.options.into.display();
            self.progress.note(&format!(
                "{name}: level {} holds all of this already",
                set.level
            ));
            return staging.skip_pass();
        }
        let publication = Publication {
            revision: dataset.revision,
            deepest_level: after.deepest_level(),
            sources: set
                .members
                .iter()
                .filter_map(|member| self.source_note(*member, set.level))
                .collect(),
        };
        self.progress
            .phase(&format!("publishing pass {}", number + 1), 1);
        staging.finish_pass(&after, publication)?;
        self.progress.advance(1);
        Ok(())
    }

    fn source_note(&self, member: usize, level: u8) -> Option<SourceNote> {
        let source = self.sources.get(member)?;
        let file = Path::new(&source.description.file);
        let file = file
            .file_name()
            .map(|name| name.to_string_lossy().into_owned())?;
        let grid = source.grid();
        let description = format!(
            "{}×{}, {}, at level {level}",
            grid.width,
            grid.height,
            grid.crs.name()
        );
        Some(SourceNote { file, description })
    }

    /// Tiles that an earlier run has finished.
    fn take_over(&self, pass: &Pass<'_>) -> Result<(), ImportError> {
        for store in [&pass.staged, &pass.finer] {
            let tiles = store
                .tiles()
                .map_err(|error| ImportError::repository(store.root(), &error))?;
            if tiles.is_empty() {
                continue;
            }
            self.progress.note(&format!(
                "{} finished tiles of an earlier run are kept",
                tiles.len()
            ));
            self.each("checking finished tiles", &tiles, |(tile, bytes)| {
                let _ = pass.take_over(*tile, *bytes);
                Ok(())
            })?;
        }
        Ok(())
    }

    /// The finest level, from the sources.
    fn resample(&self, pass: &Pass<'_>, set: &Set) -> Result<Vec<Tile>, ImportError> {
        let level = set.natural_level;
        let mut list = touched(self.sources, &set.members, self.spacings, level);
        // Tiles that exist beside those share nodes with them.
        let mut known: std::collections::HashSet<Tile> =
            list.iter().map(|(tile, _)| *tile).collect();
        let mut beside = Vec::new();
        for (tile, numbers) in &list {
            for neighbour in Direction::ALL.into_iter().filter_map(|d| tile.neighbour(d)) {
                if pass.is_old(neighbour) && known.insert(neighbour) {
                    beside.push((neighbour, numbers.clone()));
                }
            }
        }
        list.extend(beside);
        list.retain(|(tile, _)| !pass.is_made(*tile));
        self.each(
            &format!("level {level}, resampling"),
            &list,
            |(tile, numbers)| pass.make(*tile, Recipe::Sources(numbers)),
        )?;
        Ok(pass.made_at(level))
    }

    /// A coarser level from the changed tiles of the next finer one.
    fn coarsen(
        &self,
        pass: &Pass<'_>,
        level: u8,
        changed: &[Tile],
    ) -> Result<Vec<Tile>, ImportError> {
        let mut list: Vec<Tile> = changed.iter().filter_map(|tile| tile.parent()).collect();
        let beside: Vec<Tile> = list
            .iter()
            .flat_map(|tile| Direction::ALL.into_iter().filter_map(|d| tile.neighbour(d)))
            .filter(|neighbour| pass.is_old(*neighbour))
            .collect();
        list.extend(beside);
        list.sort_unstable_by_key(|tile| tile.id());
        list.dedup();
        list.retain(|tile| !pass.is_made(*tile));
        self.each(&format!("level {level}, filtering"), &list, |tile| {
            pass.make(*tile, Recipe::Children)
        })?;
        Ok(pass.made_at(level))
    }

    /// Finer tiles that the repository has already, where coarser data now lies under their holes.
    fn fill_finer(
        &self,
        pass: &Pass<'_>,
        index: &Index,
        touched: Vec<Tile>,
    ) -> Result<(), ImportError> {
        if index.deepest_level() <= pass.level {
            return Ok(());
        }
        let touched: std::collections::HashSet<Tile> = touched.into_iter().collect();
        let under = |tile: Tile| touched.contains(&tile.ancestor(pass.level));
        let old = index.tiles();
        for level in pass.level + 1..=index.deepest_level() {
            let near = |tile: Tile| {
                under(tile)
                    || Direction::ALL
                        .into_iter()
                        .filter_map(|direction| tile.neighbour(direction))
                        .any(under)
            };
            let list: Vec<Tile> = old
                .iter()
                .copied()
                .filter(|tile| tile.level() == level && near(*tile) && !pass.is_made(*tile))
                .collect();
            self.each(&format!("level {level}, filling holes"), &list, |tile| {
                pass.make(*tile, Recipe::HolesOnly)
            })?;
        }
        Ok(())
    }

    /// Does something with each item of a list, in its order, on all threads. The first error ends it.
    fn each<Item: Sync>(
        &self,
        phase: &str,
        list: &[Item],
        work: impl Fn(&Item) -> Result<(), ImportError> + Sync,
    ) -> Result<(), ImportError> {
        self.progress.phase(phase, list.len() as u64);
        let next = AtomicUsize::new(0);
        let failure: Mutex<Option<ImportError>> = Mutex::new(None);
        let failed = |error| {
            let mut failure = failure.lock().unwrap_or_else(PoisonError::into_inner);
            failure.get_or_insert(error);
            next.store(list.len(), Ordering::Relaxed);
        };
        self.pool.broadcast(|_| {
            while let Some(item) = list.get(next.fetch_add(1, Ordering::Relaxed)) {
                if self.cancel.load(Ordering::Relaxed) {
                    failed(ImportError::Cancelled);
                    break;
                }
                match work(item) {
                    Ok(()) => self.progress.advance(1),
                    Err(error) => failed(error),
                }
            }
        });
        match failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some(error) => Err(error),
            None => Ok(()),
        }
    }
}

fn load_index(repository: &Repository, into: &Path) -> Result<Index, ImportError> {
    use tiles::RepositoryError;
    match repository.load_index() {
        Ok(index) => Ok(index),
        // A description without tiles: nothing was published yet.
        Err(RepositoryError::NoIndex { .. }) if repository.dataset().revision == 0 => {
            Ok(Index::new())
        }
        Err(error) => Err(ImportError::repository(into, &error)),
    }
}

impl Pass<'_> {
    /// Tiles of a level that this pass has made, along the quadtree's curve.
    fn made_at(&self, level: u8) -> Vec<Tile> {
        let made = self.made.lock().unwrap_or_else(PoisonError::into_inner);
        let mut tiles: Vec<Tile> = made
            .keys()
            .copied()
            .filter(|t| t.level() == level)
            .collect();
        drop(made);
        tiles.sort_unstable_by_key(|tile| tile.id());
        tiles
    }
}
