//! What an unfinished import has done so far, inside the repository's directory, so that it can go on after a kill.
//! In: finished tiles. Out: the repository's new state, published by renaming. Readers see the old state or new tiles,
//! never half a tile. It does not know how tiles are made.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::UNIX_EPOCH;

use serde::{Deserialize, Serialize};
use tiles::{Dataset, DatasetError, Index, Repository, RepositoryError, SourceNote};

use crate::error::ImportError;
use crate::options::{Extent, ImportOptions, RawLayout};
use crate::progress::Progress;

const DIRECTORY: &str = ".staging";
const MANIFEST: &str = "manifest.json";
/// Finished tiles of the pass that is under way.
const TILES: &str = "tiles";
/// Tiles finer than the wanted level, which are only there to be filtered.
const FINER: &str = "finer";
/// Changes with every change of the arithmetic: tiles of another program are not continued.
const VERSION: u32 = 2;

/// Everything that decides what an import makes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Arguments {
    version: u32,
    sources: Vec<SourceFile>,
    kind: tiles::Kind,
    extent: Option<Extent>,
    crs: Option<String>,
    node_registered: Option<bool>,
    raw: Option<RawLayout>,
    nodata: Option<String>,
    level: Option<u8>,
    bands: Option<Vec<usize>>,
    range: Option<[f64; 2]>,
    planet: geodesy::Ellipsoid,
    quantum_m: Option<f64>,
}

#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
struct SourceFile {
    path: PathBuf,
    bytes: u64,
    modified_ns: u128,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Manifest {
    arguments: Arguments,
    /// The description that the repository will have; only its id, revision and sources change by import.
    dataset: Dataset,
    /// The number of the pass under way, from 0.
    pass: usize,
    /// Set once all tiles of the pass are finished: from here on there is only one way.
    publishing: Option<Publication>,
}

/// What changes in the repository when a pass is published.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Publication {
    /// The repository's revision before; the description is changed only from this one.
    pub(crate) revision: u32,
    pub(crate) deepest_level: u8,
    pub(crate) sources: Vec<SourceNote>,
}

/// The unfinished part of an import.
pub(crate) struct Staging {
    into: PathBuf,
    directory: PathBuf,
    manifest: Manifest,
    /// True where work of an earlier run is continued.
    pub(crate) resumed: bool,
}

impl Arguments {
    fn of(options: &ImportOptions) -> Result<Self, ImportError> {
        let mut sources = Vec::new();
        for path in &options.sources {
            let failed = |error| ImportError::io(path, "read", error);
            let metadata = fs::metadata(path).map_err(failed)?;
            let modified = metadata
                .modified()
                .ok()
                .and_then(|t| t.duration_since(UNIX_EPOCH).ok());
            sources.push(SourceFile {
                path: path.canonicalize().map_err(failed)?,
                bytes: metadata.len(),
                modified_ns: modified.map_or(0, |since| since.as_nanos()),
            });
        }
        Ok(Self {
            version: VERSION,
            sources,
            kind: options.kind,
            extent: options.extent,
            crs: options.crs.clone(),
            node_registered: options.node_registered,
            raw: options.raw,
            // As text, because JSON has no NaN.
            nodata: options.nodata.map(|value| value.to_string()),
            level: options.level,
            bands: options.bands.clone(),
            range: options.range,
            planet: options.planet,
            quantum_m: options.quantum_m,
        })
    }
}

impl Staging {
    /// Finds what an earlier run left in `options.into`. A publication that was under way is completed first;
    /// work with other arguments, or on another state of the repository, is discarded.
    pub(crate) fn open(
        options: &ImportOptions,
        describe: impl FnOnce(Option<&Dataset>) -> Result<Dataset, ImportError>,
        progress: &dyn Progress,
    ) -> Result<Self, ImportError> {
        let into = options.into.clone();
        let directory = into.join(DIRECTORY);
        let arguments = Arguments::of(options)?;
        let mut earlier = Self::load(&into, &directory);
        if let Some(staging) = &mut earlier
            && staging.manifest.publishing.is_some()
        {
            staging.publish()?;
        }
        let now = open_repository(&into)?;
        let dataset = describe(now.as_ref().map(Repository::dataset))?;
        if let Some(staging) = earlier {
            let (mine, theirs) = (
                &staging.manifest.dataset,
                now.as_ref().map(Repository::dataset),
            );
            let same_state = theirs.map_or(mine.revision == 0, |d| {
                d.id == mine.id && d.revision == mine.revision
            });
            let fits = staging.manifest.arguments == arguments && same_state;
            if fits {
                return Ok(staging);
            }
            let name = directory.display();
            progress.note(&format!(
                "{name}: an unfinished import with other arguments, sources or repository was discarded"
            ));
        }
        if directory.exists() {
            fs::remove_dir_all(&directory).map_err(|e| ImportError::io(&directory, "remove", e))?;
        }
        fs::create_dir_all(&directory).map_err(|e| ImportError::io(&directory, "make", e))?;
        let dataset = match now {
            Some(repository) => repository.dataset().clone(),
            None => dataset,
        };
        let manifest = Manifest {
            arguments,
            dataset,
            pass: 0,
            publishing: None,
        };
        let staging = Self {
            into,
            directory,
            manifest,
            resumed: false,
        };
        staging.store()?;
        Ok(staging)
    }

    fn load(into: &Path, directory: &Path) -> Option<Self> {
        let text = fs::read_to_string(directory.join(MANIFEST)).ok()?;
        let manifest = serde_json::from_str(&text).ok()?;
        let (into, directory) = (into.to_owned(), directory.to_owned());
        Some(Self {
            into,
            directory,
            manifest,
            resumed: true,
        })
    }

    fn store(&self) -> Result<(), ImportError> {
        let path = self.directory.join(MANIFEST);
        let part = self.directory.join("manifest.part");
        let failed = |error| ImportError::io(&path, "write", error);
        let text = serde_json::to_string_pretty(&self.manifest)
            .map_err(|error| failed(std::io::Error::other(error)))?;
        let write = || -> std::io::Result<()> {
            use std::io::Write;
            let mut file = fs::File::create(&part)?;
            file.write_all(text.as_bytes())?;
            file.sync_all()?;
            fs::rename(&part, &path)
        };
        write().map_err(failed)
    }

    /// The number of the pass to do next, from 0.
    pub(crate) const fn pass(&self) -> usize {
        self.manifest.pass
    }

    /// The description of the data set.
    pub(crate) const fn dataset(&self) -> &Dataset {
        &self.manifest.dataset
    }

    /// The store of finished tiles of this pass, and that of finer tiles that will not be kept.
    pub(crate) fn stores(&self) -> Result<(Repository, Repository), ImportError> {
        let open = |name: &str| {
            let root = self.directory.join(name);
            let store = match Repository::open(&root) {
                Ok(store) => Ok(store),
                Err(_) => Repository::create(&root, self.manifest.dataset.clone()),
            };
            store.map_err(|error| ImportError::repository(&root, &error))
        };
        Ok((open(TILES)?, open(FINER)?))
    }

    /// Ends the pass: makes its tiles and this index the state of the repository.
    pub(crate) fn finish_pass(
        &mut self,
        index: &Index,
        publication: Publication,
    ) -> Result<(), ImportError> {
        let (tiles, _) = self.stores()?;
        tiles
            .store_index(index)
            .map_err(|error| ImportError::repository(tiles.root(), &error))?;
        self.manifest.publishing = Some(publication);
        self.store()?;
        self.publish()
    }

    /// Ends a pass that changes nothing.
    pub(crate) fn skip_pass(&mut self) -> Result<(), ImportError> {
        self.manifest.pass += 1;
        self.store()
    }

    /// Moves what is left to move. May be repeated after a kill at any point.
    fn publish(&mut self) -> Result<(), ImportError> {
        let Some(publication) = self.manifest.publishing.clone() else {
            return Ok(());
        };
        let failed = |error: RepositoryError| ImportError::repository(&self.into, &error);
        let (tiles, finer) = self.stores()?;
        let mut repository = match open_repository(&self.into)? {
            Some(repository) => repository,
            None => {
                Repository::create(&self.into, self.manifest.dataset.clone()).map_err(failed)?
            }
        };
        for (tile, _) in tiles.tiles().map_err(failed)? {
            let (from, to) = (tiles.path_of(tile), repository.path_of(tile));
            if let Some(parent) = to.parent() {
                fs::create_dir_all(parent).map_err(|e| ImportError::io(parent, "make", e))?;
            }
            fs::rename(&from, &to).map_err(|error| ImportError::io(&to, "publish", error))?;
        }
        if repository.dataset().revision == publication.revision {
            let index = tiles.load_index().map_err(failed)?;
            repository.store_index(&index).map_err(failed)?;
            let change = |dataset: &mut Dataset| {
                dataset.deepest_level = dataset.deepest_level.max(publication.deepest_level);
                dataset.sources.extend(publication.sources.iter().cloned());
            };
            repository.update(change).map_err(failed)?;
        }
        self.manifest.dataset = repository.dataset().clone();
        self.manifest.pass += 1;
        self.manifest.publishing = None;
        self.store()?;
        for store in [tiles, finer] {
            let root = store.root();
            fs::remove_dir_all(root).map_err(|error| ImportError::io(root, "remove", error))?;
        }
        Ok(())
    }

    /// Removes everything, once the last pass is published or nothing can be continued.
    pub(crate) fn remove(self) -> Result<(), ImportError> {
        fs::remove_dir_all(&self.directory)
            .map_err(|error| ImportError::io(&self.directory, "remove", error))
    }
}

/// The repository in a directory; `None` where there is none yet.
pub(crate) fn open_repository(into: &Path) -> Result<Option<Repository>, ImportError> {
    match Repository::open(into) {
        Ok(repository) => Ok(Some(repository)),
        Err(RepositoryError::Dataset(DatasetError::NoRepository { .. })) => Ok(None),
        Err(error) => Err(ImportError::repository(into, &error)),
    }
}
