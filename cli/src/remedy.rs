//! The program's words for what the library reports: each cause, and the flag, the key or the column that helps.

use mrfgs::Error;
use mrfgs::check::Warning;
use mrfgs::error::{
    BudgetError, DeviceError, ExecutionError, MemoryError, OptionError, Purpose, RangeError, ReadError,
};

/// What the ends of the range are called where the user gives them.
pub(crate) struct Ends {
    min: &'static str,
    max: &'static str,
}

/// On the command line.
pub(crate) const FLAGS: Ends = Ends { min: "--min-disparity", max: "--max-disparity" };
/// In a list of pairs.
pub(crate) const COLUMNS: Ends = Ends { min: "min_disparity", max: "max_disparity" };

/// An error with its remedy.
pub(crate) fn error(error: &Error, ends: &Ends) -> String {
    match error {
        Error::Option { key, cause } => format!("--set {key}: {cause}{}", of_key(cause)),
        Error::Preset { .. } => format!("--method: {error}"),
        Error::Range(cause) => range(cause, ends),
        Error::Execution(cause) => execution(cause),
        Error::Budget(cause) => budget(cause),
        Error::Read { cause, .. } => format!("{error}{}", reading(cause)),
        Error::Device(cause) => format!("{error}{}", device(cause)),
        Error::Memory(cause) => format!("{error}{}", memory(cause)),
        _ => error.to_string(),
    }
}

/// A warning with its remedy.
pub(crate) fn warning(warning: &Warning, Ends { min, max }: &Ends) -> String {
    match warning {
        Warning::Saturated { .. } => format!("{warning}: expose both alike, or --mask what is no image"),
        Warning::Swapped { .. } => {
            format!("{warning}: exchange the two images, or give a negative {min} if the cameras converge")
        }
        Warning::Clipped { upper: true, .. } => format!("{warning}: raise {max}"),
        Warning::Clipped { upper: false, .. } => format!("{warning}: lower {min}"),
        _ => warning.to_string(),
    }
}

fn of_key(cause: &OptionError) -> &'static str {
    match cause {
        OptionError::Unknown => "; `mrfgs presets` lists the keys",
        _ => "",
    }
}

fn range(cause: &RangeError, Ends { min, max }: &Ends) -> String {
    match cause {
        RangeError::Empty { .. } => format!("{max}: {cause}: raise it or lower {min}"),
        RangeError::TooFar { disparity, .. } if *disparity < 0 => format!("{min}: {cause}"),
        RangeError::TooManyLabels { .. } => format!("{max}: {cause}: narrow the range"),
        RangeError::OutsideImages { .. } => format!("{max}: {cause}: give a range that fits the pair"),
        RangeError::NotFound => format!("{cause}: give {max}"),
        _ => format!("{max}: {cause}"),
    }
}

fn execution(cause: &ExecutionError) -> String {
    match cause {
        ExecutionError::NoSuchDevice { .. } => format!("--device: {cause}; see `mrfgs devices`"),
        _ => format!("--threads: {cause}"),
    }
}

fn budget(cause: &BudgetError) -> String {
    match cause {
        BudgetError::NoTileFits { needed, .. } => {
            format!("--memory: {cause}; give at least {needed}MiB, or a smaller image or range")
        }
        BudgetError::Steps { needed } => {
            format!("DIR: {cause}; give --memory {needed}MiB")
        }
        _ => format!("--memory: {cause}"),
    }
}

fn reading(cause: &ReadError) -> &'static str {
    match cause {
        ReadError::TooManyPixels { .. } => "; if that is true, raise --max-pixels or crop it",
        ReadError::TooManyBytes { .. } => "; raise --max-pixels or crop it",
        ReadError::UnknownScale => "; of a ground truth, give the scale by --truth-scale",
        ReadError::NeedlessScale => "; remove --truth-scale",
        ReadError::NoData { .. } => "; give one by --no-data",
        ReadError::Option { cause, .. } => of_key(cause),
        ReadError::Memory(cause) => memory(cause),
        _ => "",
    }
}

fn device(cause: &DeviceError) -> &'static str {
    match cause {
        DeviceError::NoDriver => {
            ": install the driver of the GPU, or a software one (Mesa's lavapipe), or use --device cpu"
        }
        DeviceError::WrongMaps { .. } => ": update its driver, or use --device cpu",
        DeviceError::TooLargeForShader { .. } => ": use --device cpu",
        _ => "; use another --device or --device cpu",
    }
}

fn memory(cause: &MemoryError) -> &'static str {
    match cause {
        MemoryError::Machine { purpose: Purpose::Match, .. } => {
            ": allow less by --memory, or use a smaller image, a narrower range (--min-disparity, --max-disparity) or \
             fewer neighbours (a higher --set percentile)"
        }
        MemoryError::Machine { .. } => ": use a smaller image, or a part of it",
        MemoryError::Device { .. } => ": use --device cpu, or a smaller --memory, image or range",
        MemoryError::Exhausted { .. } => ": use --device cpu, another --device, or a smaller image or range",
        _ => ": use --device cpu, or a smaller image or range",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn said(cause: impl Into<Error>) -> String {
        error(&cause.into(), &FLAGS)
    }

    /// Whoever meets one of these reads what is wrong, the flag and the remedy, in one line.
    #[test]
    fn every_cause_has_a_remedy() {
        let name = || "a device".to_owned();
        let read = |cause: ReadError| Error::read("a.png", cause);
        let machine = |purpose| MemoryError::Machine { needed: 3 << 30, available: None, purpose };
        let too_small = BudgetError::NoTileFits { memory: 1, width: 60, height: 40, labels: 9, needed: 7 };
        let many = DeviceError::TooLargeForShader {
            width: 9,
            height: 5,
            labels: 9_000,
            neighbours: 3,
            shader: "flood",
        };
        let unknown = |line| ReadError::Option { line, key: "colour".into(), cause: OptionError::Unknown };
        let found = || vec!["0: llvmpipe".to_owned()];
        for (said, words) in [
            (
                said(Error::option("colour", OptionError::Unknown)),
                ["--set colour: there is no such key", "`mrfgs presets`"],
            ),
            (
                said(Error::option("levels", OptionError::OutOfRange { value: 17.0, low: 1.0, high: 16.0 })),
                ["--set levels: 17", "1 to 16"],
            ),
            (
                said(Error::option(
                    "cost",
                    OptionError::WrongKind { expected: "sad | census".into(), found: "\"ncc\"".into() },
                )),
                ["--set cost", "sad | census"],
            ),
            (
                said(Error::option("sad-window", OptionError::NotOdd { value: 4 })),
                ["--set sad-window", "take 3 or 5"],
            ),
            (
                said(Error::Preset { name: "best".into(), known: vec!["default", "paper"] }),
                ["--method", "default, paper"],
            ),
            (
                said(RangeError::Empty { min: 5, max: 4 }),
                ["--max-disparity: 4 is below", "lower --min-disparity"],
            ),
            (said(RangeError::TooFar { disparity: 9_999_999, limit: 9 }), ["--max-disparity", "within 9 px"]),
            (said(RangeError::TooFar { disparity: -9_999_999, limit: 9 }), ["--min-disparity", "within 9"]),
            (
                said(RangeError::TooManyLabels { min: 0, max: 20_000, limit: 16_384 }),
                ["--max-disparity: 0 to 20000 are 20001 labels", "narrow the range"],
            ),
            (
                said(RangeError::OutsideImages { min: 60, max: 70, width: 60 }),
                ["--max-disparity", "give a range"],
            ),
            (said(RangeError::NotFound), ["too few matches", "give --max-disparity"]),
            (
                said(ExecutionError::NoSuchDevice { wanted: "x".into(), present: found() }),
                ["--device", "`mrfgs devices`"],
            ),
            (said(ExecutionError::NoThreads), ["--threads", "at least 1"]),
            (said(ExecutionError::Threads("limit".into())), ["--threads", "limit"]),
            (said(too_small), ["--memory: 1 MiB", "give at least 7MiB"]),
            (said(BudgetError::Steps { needed: 70 }), ["DIR", "--memory 70MiB"]),
            (
                said(read(ReadError::TooManyPixels { width: 9, height: 9, limit: 5 })),
                ["a.png", "raise --max-pixels"],
            ),
            (said(read(ReadError::TooManyBytes { limit: 5 })), ["5 pixels", "raise --max-pixels"]),
            (said(read(ReadError::UnknownScale)), ["8-bit", "--truth-scale"]),
            (said(read(ReadError::NeedlessScale)), ["8-bit", "remove --truth-scale"]),
            (said(read(ReadError::NoData { value: "`none`".into() })), ["`none`", "--no-data"]),
            (said(read(unknown(Some(2)))), ["line 2: colour", "`mrfgs presets`"]),
            (said(read(unknown(None))), ["a.png: colour", "`mrfgs presets`"]),
            (said(read(machine(Purpose::Image).into())), ["3.0 GiB", "smaller image"]),
            (said(DeviceError::NoDriver), ["install the driver", "--device cpu"]),
            (said(DeviceError::WrongMaps { name: name() }), ["update its driver", "--device cpu"]),
            (said(many), ["9000 labels", "--device cpu"]),
            (
                said(DeviceError::Failed { name: name(), reason: "lost".into() }),
                ["another --device", "--device cpu"],
            ),
            (said(machine(Purpose::Match)), ["3.0 GiB", "by --memory"]),
            (said(machine(Purpose::Image)), ["3.0 GiB", "smaller image"]),
            (
                said(MemoryError::Device { name: name(), needed: 2 << 20, available: 1 << 20 }),
                ["2 MiB", "--device cpu"],
            ),
            (
                said(MemoryError::Buffer {
                    name: name(),
                    what: "messages".into(),
                    needed: 2048,
                    allowed: 1024,
                }),
                ["2 KiB", "--device cpu"],
            ),
            (said(MemoryError::Exhausted { name: name() }), ["another --device", "--device cpu"]),
        ] {
            assert!(words.iter().all(|word| said.contains(word)) && !said.contains('\n'), "{said}");
        }
    }

    #[test]
    fn warnings_name_the_flag() {
        for (warning, words) in [
            (Warning::Saturated { percent: [1, 37] }, "--mask"),
            (Warning::Swapped { percent: 97 }, "negative --min-disparity"),
            (Warning::Clipped { end: 63, upper: true, percent: 9 }, ": raise --max-disparity"),
            (Warning::Clipped { end: -5, upper: false, percent: 9 }, ": lower --min-disparity"),
        ] {
            let said = self::warning(&warning, &FLAGS);
            assert!(said.contains(words) && !said.contains('\n'), "{said}");
        }
    }

    #[test]
    fn a_list_has_columns_and_no_flags() {
        for cause in [
            RangeError::Empty { min: 5, max: 4 },
            RangeError::TooFar { disparity: -9_999_999, limit: 9 },
            RangeError::TooManyLabels { min: 0, max: 20_000, limit: 16_384 },
            RangeError::OutsideImages { min: 60, max: 70, width: 60 },
            RangeError::NotFound,
        ] {
            let said = error(&cause.into(), &COLUMNS);
            assert!(said.contains("_disparity") && !said.contains("--"), "{said}");
        }
        for upper in [false, true] {
            let said = warning(&Warning::Clipped { end: 63, upper, percent: 9 }, &COLUMNS);
            assert!(said.contains("_disparity") && !said.contains("--"), "{said}");
        }
    }
}
