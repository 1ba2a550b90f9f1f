//! Neural networks through ONNX Runtime: finds the shared library and the model files, runs a model on plain tensors.
//!
//! Every [`Model`] is a session with one thread: on a machine with several cores one model per worker is faster than
//! one model on all cores, and a model can be moved to another thread but is run by one at a time.

use std::{
    env, fmt,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

use ort::{
    environment::Environment,
    session::{Session, SessionInputValue, builder::GraphOptimizationLevel},
    value::TensorRef,
};

/// Environment variable that names the shared library of ONNX Runtime.
pub const LIBRARY_VARIABLE: &str = "HOLOPITCH_ONNXRUNTIME";
/// Environment variable that names the folder `assets`, which holds `models/`.
pub const ASSETS_VARIABLE: &str = "HOLOPITCH_ASSETS";

const LIBRARY_NAME: &str = if cfg!(target_os = "windows") {
    "onnxruntime.dll"
} else if cfg!(target_os = "macos") {
    "libonnxruntime.dylib"
} else {
    "libonnxruntime.so"
};

/// Why a network could not be loaded or run.
#[derive(Debug, thiserror::Error)]
pub enum InferenceError {
    /// The shared library is in none of the known places.
    #[error("ONNX Runtime not found: looked at {}; run `cargo xtask setup` or set {LIBRARY_VARIABLE}", Places(.looked_at))]
    LibraryNotFound {
        /// Every path that was tried.
        looked_at: Vec<PathBuf>,
    },
    /// A file was found but is not a usable ONNX Runtime.
    #[error("{}: not a usable ONNX Runtime: {reason}; run `cargo xtask setup` for the right version", .path.display())]
    LibraryUnusable {
        /// The library.
        path: PathBuf,
        /// What the loader said.
        reason: String,
    },
    /// A model file is in none of the known places.
    #[error("model {name} not found: looked at {}; run from the project or set {ASSETS_VARIABLE}", Places(.looked_at))]
    ModelNotFound {
        /// File name of the model.
        name: String,
        /// Every path that was tried.
        looked_at: Vec<PathBuf>,
    },
    /// A model file is damaged, or of a kind that this runtime does not know.
    #[error("{}: cannot load the model: {reason}; restore the file from the project", .path.display())]
    ModelUnusable {
        /// The model.
        path: PathBuf,
        /// What the runtime said.
        reason: String,
    },
    /// The model refused the input or failed while it ran.
    #[error("{}: the model failed: {reason}", .path.display())]
    Run {
        /// The model.
        path: PathBuf,
        /// What the runtime said.
        reason: String,
    },
    /// The model gave something else than its model card says.
    #[error("{}: {expected} expected in the model's output, found {found}; restore the file from the project", .path.display())]
    UnexpectedOutput {
        /// The model.
        path: PathBuf,
        /// What the caller needs.
        expected: String,
        /// Names and shapes that came.
        found: String,
    },
}

/// Prints a list of paths in a sentence.
struct Places<'a>(&'a [PathBuf]);

impl fmt::Display for Places<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (i, path) in self.0.iter().enumerate() {
            if i > 0 {
                f.write_str(", ")?;
            }
            write!(f, "{}", path.display())?;
        }
        Ok(())
    }
}

/// The process-wide runtime; `ort` allows one, and drops it when nobody holds it.
static ENVIRONMENT: Mutex<Option<Environment>> = Mutex::new(None);

/// Loads ONNX Runtime, once per process; later calls do nothing.
///
/// The library is `library` if given; else what [`LIBRARY_VARIABLE`] names; else the first that exists of: beside the
/// executable, and `target/setup/onnxruntime/` of a folder above the executable or of the source tree.
///
/// # Errors
/// [`InferenceError::LibraryNotFound`] with every place that was looked at, [`InferenceError::LibraryUnusable`] when
/// the file is no ONNX Runtime or is too old.
pub fn initialize(library: Option<&Path>) -> Result<(), InferenceError> {
    environment(library).map(drop)
}

fn environment(library: Option<&Path>) -> Result<Environment, InferenceError> {
    let mut slot = ENVIRONMENT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(environment) = slot.as_ref() {
        return Ok(environment.clone());
    }
    let path = first_file(library_places(library))
        .map_err(|looked_at| InferenceError::LibraryNotFound { looked_at })?;
    let unusable = |reason: String| InferenceError::LibraryUnusable { path: path.clone(), reason };
    let environment = ort::init_from(&path)
        .map_err(|e| unusable(e.to_string()))?
        .with_name("holopitch")
        .with_telemetry(false)
        .build()
        .map_err(|e| unusable(e.to_string()))?;
    tracing::debug!(library = %path.display(), "ONNX Runtime loaded");
    *slot = Some(environment.clone());
    Ok(environment)
}

/// The file of a model that ships with the project, by its file name (`people.onnx`).
///
/// Looks into `models/` of the folder that [`ASSETS_VARIABLE`] names, else into `assets/models/` beside the executable,
/// of a folder above it, and of the source tree.
///
/// # Errors
/// [`InferenceError::ModelNotFound`] with every place that was looked at.
pub fn model_path(name: &str) -> Result<PathBuf, InferenceError> {
    let places = match env::var_os(ASSETS_VARIABLE) {
        Some(assets) => vec![PathBuf::from(assets).join("models").join(name)],
        None => above().map(|folder| folder.join("assets/models").join(name)).collect(),
    };
    first_file(places).map_err(|looked_at| InferenceError::ModelNotFound { name: name.into(), looked_at })
}

/// The executable's folder and those above it, then the source tree this was built from.
fn above() -> impl Iterator<Item = PathBuf> {
    let executable = env::current_exe().unwrap_or_default();
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).parent().map(Path::to_path_buf);
    let folders: Vec<PathBuf> = executable.ancestors().skip(1).map(Path::to_path_buf).collect();
    // The folders of a build lie at most four below the workspace; a whole path to the root would flood the message.
    folders.into_iter().take(5).chain(source)
}

fn library_places(library: Option<&Path>) -> Vec<PathBuf> {
    if let Some(path) = library {
        return vec![path.to_path_buf()];
    }
    if let Some(path) = env::var_os(LIBRARY_VARIABLE) {
        return vec![PathBuf::from(path)];
    }
    let beside = above().next().map(|folder| folder.join(LIBRARY_NAME));
    let set_up = above().map(|folder| folder.join("target/setup/onnxruntime").join(LIBRARY_NAME));
    beside.into_iter().chain(set_up).collect()
}

fn first_file(places: Vec<PathBuf>) -> Result<PathBuf, Vec<PathBuf>> {
    match places.iter().find(|path| path.is_file()) {
        Some(path) => Ok(path.clone()),
        None => Err(places),
    }
}

/// A tensor that a model gave: numbers in row-major order.
#[derive(Clone, Debug, PartialEq)]
pub struct Tensor {
    /// Name of the output in the model.
    pub name: String,
    /// Length of each dimension.
    pub shape: Vec<usize>,
    /// `shape[0] · shape[1] · …` numbers, the last dimension fastest.
    pub data: Vec<f32>,
}

/// A tensor to put into a model: its shape, and its numbers in row-major order.
pub type TensorView<'a> = (&'a [usize], &'a [f32]);

/// A network, ready to run on one thread.
#[derive(Debug)]
pub struct Model {
    path: PathBuf,
    session: Session,
}

impl Model {
    /// Loads a model file; loads ONNX Runtime before if nobody did.
    ///
    /// # Errors
    /// As [`initialize`]; [`InferenceError::ModelUnusable`] when the file is missing, damaged or of an unknown kind.
    pub fn load(path: &Path) -> Result<Self, InferenceError> {
        let environment = environment(None)?;
        let session = build_session(&environment, path)
            .map_err(|e| InferenceError::ModelUnusable { path: path.to_path_buf(), reason: e.to_string() })?;
        Ok(Self { path: path.to_path_buf(), session })
    }

    /// Loads a model that ships with the project, by its file name.
    ///
    /// # Errors
    /// As [`model_path`] and [`Model::load`].
    pub fn load_shipped(name: &str) -> Result<Self, InferenceError> {
        Self::load(&model_path(name)?)
    }

    /// The file the model was loaded from.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Runs the model on 32-bit tensors in the order of its inputs; gives all its outputs in its order.
    ///
    /// # Errors
    /// [`InferenceError::Run`] when a shape does not match its numbers or the model's input.
    pub fn run(&mut self, inputs: &[TensorView<'_>]) -> Result<Vec<Tensor>, InferenceError> {
        run_session(&mut self.session, inputs)
            .map_err(|e| InferenceError::Run { path: self.path.clone(), reason: e.to_string() })
    }

    /// The error for outputs that are not what the caller expects.
    #[must_use]
    pub fn unexpected(&self, expected: &str, outputs: &[Tensor]) -> InferenceError {
        let found: Vec<String> = outputs.iter().map(|t| format!("{} {:?}", t.name, t.shape)).collect();
        InferenceError::UnexpectedOutput {
            path: self.path.clone(),
            expected: expected.into(),
            found: if found.is_empty() { "nothing".into() } else { found.join(", ") },
        }
    }
}

fn build_session(environment: &Environment, path: &Path) -> ort::Result<Session> {
    Session::builder(environment)?
        .with_optimization_level(GraphOptimizationLevel::Level3)?
        .with_intra_threads(1)?
        .with_inter_threads(1)?
        .commit_from_file(path)
}

fn run_session(session: &mut Session, inputs: &[TensorView<'_>]) -> ort::Result<Vec<Tensor>> {
    let expected = session.inputs().len();
    if inputs.len() != expected {
        return Err(ort::Error::new(format!("{expected} inputs expected, {} given", inputs.len())));
    }
    let values = inputs
        .iter()
        .map(|&(shape, data)| Ok(SessionInputValue::from(TensorRef::from_array_view((shape, data))?)))
        .collect::<ort::Result<Vec<_>>>()?;
    let outputs = session.run(values.as_slice())?;
    outputs
        .iter()
        .map(|(name, value)| {
            let (shape, data) = value.try_extract_tensor::<f32>()?;
            let shape = shape.iter().map(|&n| usize::try_from(n).unwrap_or(0)).collect();
            Ok(Tensor { name: name.to_string(), shape, data: data.to_vec() })
        })
        .collect()
}

/// Whether networks can run here; a test that needs them says why not and passes, unless everything is required.
#[cfg(test)]
pub(crate) fn ready() -> bool {
    let Err(error) = initialize(None) else { return true };
    let required = env::var_os("HOLOPITCH_REQUIRE_TOOLS").is_some_and(|value| value == "1");
    assert!(!required, "{error}");
    println!("skipped: {error}");
    false
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_model_that_is_not_there_is_named_with_the_places_looked_at() {
        let error = model_path("no_such_model.onnx").unwrap_err();
        let message = error.to_string();
        assert!(message.contains("no_such_model.onnx") && message.contains("assets/models"), "{message}");
        assert!(message.contains(ASSETS_VARIABLE), "{message}");
    }

    #[test]
    fn a_library_that_is_given_is_the_only_place_looked_at() {
        let places = library_places(Some(Path::new("/nowhere/libonnxruntime.so")));
        assert_eq!(places, [PathBuf::from("/nowhere/libonnxruntime.so")]);
        let looked_at = first_file(places).unwrap_err();
        let message = InferenceError::LibraryNotFound { looked_at }.to_string();
        assert!(
            message.contains("/nowhere/libonnxruntime.so") && message.contains("cargo xtask setup"),
            "{message}"
        );
    }

    #[test]
    fn a_file_that_is_no_model_is_refused() {
        if !ready() {
            return;
        }
        let mut file = tempfile::NamedTempFile::new().unwrap();
        std::io::Write::write_all(&mut file, b"not a model at all").unwrap();
        assert!(matches!(Model::load(file.path()), Err(InferenceError::ModelUnusable { .. })));
    }

    #[test]
    fn a_wrong_shape_is_an_error_and_the_model_still_runs_after_it() {
        if !ready() {
            return;
        }
        let mut model = Model::load_shipped("blazepose_full.onnx").unwrap();
        let crop = vec![0.0; 256 * 256 * 3];
        assert!(matches!(model.run(&[(&[1, 3, 256, 256], &crop)]), Err(InferenceError::Run { .. })));
        assert!(matches!(model.run(&[(&[1, 256, 256, 4], &crop)]), Err(InferenceError::Run { .. })));
        assert!(matches!(model.run(&[]), Err(InferenceError::Run { .. })));
        let outputs = model.run(&[(&[1, 256, 256, 3], &crop)]).unwrap();
        assert!(outputs.iter().any(|t| t.shape == [1, 195] && t.data.len() == 195));
    }
}
