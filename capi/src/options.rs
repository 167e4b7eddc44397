//! Options by name, as text or numbers, and from a file.

use std::ffi::c_char;

use serde_json::{Value, json, to_value};
use surefix::{Config, Motion, Settings};

use crate::door::{ErrorText, Failure, Status, door, give, object_mut, path, take, text};

/// The options of a localizer, those of surefix.Localizer in Python: sequence_length, weight,
/// tolerance, smoothing, gradient, floor, speeds, motion; those of a motion, such as motion.pace;
/// and threads, the number of threads that scan the map.
#[derive(Clone, Debug, Default)]
pub struct Options {
    pub(crate) settings: Settings,
    /// `None` for the number that suits the map.
    pub(crate) threads: Option<usize>,
}

/// The value of an option as it is given.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Given<'a> {
    Text(&'a str),
    Number(f64),
}

const WHOLE: &str = "a whole number of 0 or more";

impl Options {
    pub(crate) fn set(&mut self, name: &str, given: Given<'_>) -> Result<(), Failure> {
        if name == "threads" {
            let threads = given.whole().ok_or_else(|| refused(name, WHOLE, given))?;
            self.threads = Some(threads as usize);
            return Ok(());
        }
        let mut options = json(name, &self.settings.config)?;
        if let Some(field) = name.strip_prefix("motion.") {
            let motion = self.settings.config.motion.clone().unwrap_or_default();
            let mut fields = json(name, &motion)?;
            fields[field] = given.of_type(name, fields.get(field), || names("motion.", &fields))?;
            options["motion"] = fields;
        } else {
            let known = || format!("{}, threads", names("", &options));
            options[name] = match name {
                "motion" if matches!(given, Given::Text("none")) => Value::Null,
                "motion" => given.word(name, "steady, free, any, loops or none")?,
                "gradient" => given.word(name, "halved or unhalved")?,
                "floor" => match given.number() {
                    Some(floor) => json!({ "fixed": floor }),
                    None => given.word(name, "running, global or a number")?,
                },
                _ => given.of_type(name, options.get(name), known)?,
            };
        }
        let config: Config = serde_json::from_value(options)
            .map_err(|error| Failure::argument(format!("option `{name}`: {error}")))?;
        config.motion.as_ref().map_or(Ok(()), Motion::validate)?;
        if self.settings.threshold.is_some() && config != self.settings.config {
            let expected = "that of the settings, whose threshold was calibrated with it";
            return Err(refused(name, expected, given));
        }
        self.settings.config = config;
        Ok(())
    }
}

impl Given<'_> {
    fn number(self) -> Option<f64> {
        let number = match self {
            Self::Text(text) => text.trim().parse().ok()?,
            Self::Number(number) => number,
        };
        number.is_finite().then_some(number)
    }

    fn whole(self) -> Option<u64> {
        let number = self.number()?;
        (number >= 0.0 && number.fract() == 0.0 && number < 2_f64.powi(53)).then_some(number as u64)
    }

    fn list(self) -> Option<Value> {
        let Self::Text(text) = self else { return self.number().map(|number| json!([number])) };
        let numbers = text.split(',').map(|part| Given::Text(part).number());
        numbers.collect::<Option<Vec<f64>>>().map(|numbers| json!(numbers))
    }

    fn flag(self) -> Option<bool> {
        match self {
            Self::Text("true") => Some(true),
            Self::Text("false") => Some(false),
            Self::Text(_) => None,
            Self::Number(number) => [(0.0, false), (1.0, true)]
                .into_iter()
                .find_map(|(known, flag)| (known == number).then_some(flag)),
        }
    }

    /// A word, which the option's own type checks.
    fn word(self, name: &str, expected: &str) -> Result<Value, Failure> {
        match self {
            Self::Text(text) if self.number().is_none() => Ok(json!(text)),
            _ => Err(refused(name, expected, self)),
        }
    }

    /// The value in the type of the one that an option has.
    fn of_type(
        self,
        name: &str,
        has: Option<&Value>,
        known: impl FnOnce() -> String,
    ) -> Result<Value, Failure> {
        let (expected, value) = match has {
            None => {
                let message = format!("option `{name}`: expected one of {}", known());
                return Err(Failure::argument(message));
            }
            Some(Value::Array(_)) => ("numbers with commas between them", self.list()),
            Some(Value::Bool(_)) => ("true or false", self.flag().map(Value::from)),
            Some(has) if has.is_u64() => (WHOLE, self.whole().map(Value::from)),
            Some(_) => ("a number", self.number().map(Value::from)),
        };
        value.ok_or_else(|| refused(name, expected, self))
    }
}

fn json(name: &str, options: &impl serde::Serialize) -> Result<Value, Failure> {
    to_value(options).map_err(|error| Failure::argument(format!("option `{name}`: {error}")))
}

/// The names of some options.
fn names(prefix: &str, options: &Value) -> String {
    let names = options.as_object().into_iter().flat_map(|options| options.keys());
    names.map(|name| format!("{prefix}{name}")).collect::<Vec<_>>().join(", ")
}

fn refused(name: &str, expected: &str, given: Given<'_>) -> Failure {
    let got = match given {
        Given::Text(text) => format!("{text:?}"),
        Given::Number(number) => number.to_string(),
    };
    Failure::argument(format!("option `{name}`: expected {expected}, got {got}"))
}

/// The defaults. Free them with surefix_options_free; localizers that are made of them keep what
/// they need.
///
/// Errors: none but of a NULL.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_options_new(
    options: *mut *mut Options,
    error: *mut ErrorText,
) -> Status {
    // SAFETY: the contract of the header.
    door(error, || unsafe { give(options, || Ok(Options::default())) })
}

/// Ends options. NULL is allowed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_options_free(options: *mut Options) {
    // SAFETY: the contract of the header.
    unsafe { take(options) }
}

/// Sets an option by its name. The value is text, as on the command line: "5" for sequence_length,
/// "0.9,1,1.1" for speeds, "steady", "free", "any" or "none" for motion.
///
/// Errors: SUREFIX_STATUS_ARGUMENT for an unknown name or a value of another kind. Ranges that
/// depend on the map are checked by surefix_localizer_new.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_options_set(
    options: *mut Options,
    name: *const c_char,
    value: *const c_char,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let (options, name, value) = unsafe {
            (object_mut(options, "options")?, text(name, "name")?, text(value, "value")?)
        };
        options.set(name, Given::Text(value))
    })
}

/// Sets an option that is a number.
///
/// Errors: as for surefix_options_set.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_options_set_number(
    options: *mut Options,
    name: *const c_char,
    value: f64,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let (options, name) = unsafe { (object_mut(options, "options")?, text(name, "name")?) };
        options.set(name, Given::Number(value))
    })
}

/// Takes the settings of a file, as `surefix tune` writes them (route.toml), in place of all that
/// was set but the threads: options, a threshold, and the map that they are for. Beside a threshold
/// no option can be changed.
///
/// Errors: SUREFIX_STATUS_FILE if the file cannot be read, SUREFIX_STATUS_FORMAT if it holds no
/// settings.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn surefix_options_load(
    options: *mut Options,
    path: *const c_char,
    error: *mut ErrorText,
) -> Status {
    door(error, || {
        // SAFETY: the contract of the header.
        let (options, path) = unsafe { (object_mut(options, "options")?, self::path(path)?) };
        options.settings = Settings::open(path)?;
        Ok(())
    })
}
