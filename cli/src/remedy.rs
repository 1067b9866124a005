//! The remedies in messages: flags of the command line, and columns of a list.

pub(crate) use mrfgs::remedy::{Vocabulary, doubt, error, of_rectified, warning};

/// Words for flags of the command line.
pub(crate) const FLAGS: Vocabulary = Vocabulary {
    key: ["--set ", ""],
    keys: Some("`mrfgs presets` lists the keys"),
    preset: "--method",
    min: "--min-disparity",
    max: "--max-disparity",
    device: "--device",
    devices: Some("see `mrfgs devices`"),
    cpu: "use --device cpu",
    driver: ["install the driver of the GPU, or a software one (Mesa's lavapipe)", "update its driver"],
    threads: "--threads",
    memory: Some(["--memory", "MiB"]),
    steps: Some("DIR"),
    mask: Some("mask what is not image with --mask"),
    max_pixels: Some("--max-pixels"),
    truth_scale: Some("--scale (for ground truth: --truth-scale)"),
    no_data: Some("--no-data"),
    calibration: "a calibration with --calib",
    orient: Some("--orient"),
    rectify: Some("add --rectify (and --calib FILE if you have a calibration)"),
    unit: Some("give the right one in the file as an entry `unit`: mm, cm or m"),
    crop: Some("--calib-crop"),
    ..Vocabulary::PLAIN
};

/// Words for cameras given as numbers on the command line.
pub(crate) const NUMBERS: Vocabulary =
    Vocabulary { unit: Some("give the right one with the number, such as 120mm, 12cm or 0.12m"), ..FLAGS };

/// Words for cameras of a recording or of live topics, whose messages have no entry for the unit.
pub(crate) const MESSAGES: Vocabulary =
    Vocabulary { unit: Some("give another calibration with --calib"), ..FLAGS };

/// Words for a list of pairs.
pub(crate) const COLUMNS: Vocabulary = Vocabulary {
    min: "min_disparity",
    max: "max_disparity",
    rectify: Some("add --rectify (and a column calibration if you have one)"),
    ..FLAGS
};

#[cfg(test)]
mod tests {
    use mrfgs::Error;
    use mrfgs::check::{Part, Warning};
    use mrfgs::error::{
        BudgetError, DeviceError, ExecutionError, MemoryError, OptionError, Purpose, RangeError, ReadError,
        RectificationError,
    };

    use super::*;

    /// Every cause, with the words that its message must contain in order.
    fn every() -> Vec<(Error, &'static str)> {
        let name = || "a device".to_owned();
        let option = |key: &str, cause| Error::option(key, cause);
        let kind = |expected: &str, found: &str| OptionError::WrongKind {
            expected: expected.into(),
            found: found.into(),
        };
        let out_of_range = OptionError::OutOfRange { value: 17.0, low: 1.0, high: 16.0 };
        let in_group = OptionError::InGroup { key: "cost.sad-window".into() };
        let is_group = OptionError::IsGroup { keys: vec!["sad-window".into()] };
        let preset = Error::Preset { name: "best".into(), known: vec!["default", "paper"] };
        let labels = |min, max| Error::from(RangeError::TooManyLabels { min, max, limit: 16_384 });
        let far = |disparity| Error::from(RangeError::TooFar { disparity, limit: 9 });
        let no_device =
            ExecutionError::NoSuchDevice { wanted: "x".into(), present: vec!["0: llvmpipe".into()] };
        let too_small = BudgetError::NoTileFits { memory: 1, width: 60, height: 40, labels: 9, needed: 7 };
        let read = |cause: ReadError| Error::read("a.png", cause);
        let unknown = |line| ReadError::Option { line, key: "colour".into(), cause: OptionError::Unknown };
        let too_large = DeviceError::TooLargeForShader {
            width: 9,
            height: 5,
            labels: 9_000,
            neighbours: 3,
            shader: "flood",
        };
        let failed = DeviceError::Failed { name: name(), reason: "lost".into() };
        let machine = |available, purpose| MemoryError::Machine { needed: 3 << 30, available, purpose };
        let on_device = MemoryError::Device { name: name(), needed: 2 << 20, available: 1 << 20 };
        let buffer =
            MemoryError::Buffer { name: name(), what: "messages".into(), needed: 2048, allowed: 1024 };
        vec![
            (
                option("colour", OptionError::Unknown),
                "--set colour: there is no such key ... `mrfgs presets`",
            ),
            (option("levels", out_of_range), "--set levels: 17 ... 1 to 16"),
            (option("cost", kind("sad | census", "\"ncc\"")), "--set cost ... sad | census"),
            (option("levels", kind("levels, 1 to 16", "2.5")), "--set levels ... not 2.5"),
            (option("sad-window", OptionError::NotOdd { value: 4 }), "--set sad-window ... take 3 or 5"),
            (option("sad-window", in_group), "--set sad-window ... it is `cost.sad-window`"),
            (option("cost", is_group), "--set cost ... one of its keys: sad-window"),
            (option("cost", OptionError::Repeated { line: 2 }), "--set cost ... line 2"),
            (preset, "--method ... default, paper"),
            (
                RangeError::Empty { min: 5, max: 4 }.into(),
                "--max-disparity: 4 is below ... lower --min-disparity",
            ),
            (far(9_999_999), "--max-disparity ... within 9 px"),
            (far(-9_999_999), "--min-disparity ... within 9"),
            (labels(0, 20_000), "--max-disparity: 0 to 20000 are 20001 disparities ... narrow the range"),
            (labels(i32::MIN, i32::MAX), "4294967296 disparities"),
            (
                RangeError::OutsideImages { min: 60, max: 70, width: 60 }.into(),
                "--max-disparity ... give a range",
            ),
            (
                RangeError::NotFound { cause: None }.into(),
                "too few matches ... same scene, or give --max-disparity",
            ),
            (
                RangeError::NotRectified.into(),
                "not rectified ... add --rectify ... --calib FILE ... or give --max-disparity",
            ),
            (
                RangeError::NotFound { cause: Some("it is plain".into()) }.into(),
                "no range of disparities found: it is plain",
            ),
            (no_device.into(), "--device ... 0: llvmpipe ... `mrfgs devices`"),
            (
                ExecutionError::ThreadCount { wanted: 0, most: 9 }.into(),
                "--threads: 0 threads ... give 1 to 9",
            ),
            (ExecutionError::Threads("limit".into()).into(), "--threads ... limit"),
            (too_small.into(), "--memory: 1 MiB ... give at least 7MiB"),
            (BudgetError::Steps { needed: 70 }.into(), "DIR: to show the steps ... --memory 70MiB"),
            (
                read(ReadError::TooManyPixels { width: 9, height: 9, limit: 5 }),
                "a.png ... raise --max-pixels",
            ),
            (read(ReadError::TooManyBytes { limit: 5 }), "5 pixels ... raise --max-pixels"),
            (read(ReadError::UnknownScale), "whole numbers ... --truth-scale"),
            (read(ReadError::NeedlessScale), "whole numbers ... remove --scale"),
            (read(ReadError::NoData { value: "`none`".into() }), "`none` ... --no-data"),
            (read(unknown(Some(2))), "line 2: colour ... `mrfgs presets`"),
            (read(unknown(None)), "a.png: colour ... `mrfgs presets`"),
            (read(machine(None, Purpose::Image).into()), "3.0 GiB ... smaller image"),
            (read("is empty".into()), "cannot read a.png: is empty"),
            (Error::write("a.png", "disk full"), "cannot write a.png: disk full"),
            (Error::Calibration("does not say baseline".into()), "the calibration does not say baseline"),
            (
                RectificationError::Few { agreeing: 3, matches: 9, least: 30 }.into(),
                "without a calibration: only 3 of 9 matches agree ... same scene ... --calib",
            ),
            (RectificationError::Flat.into(), "no depth ... step to the side ... --calib"),
            (RectificationError::Forward.into(), "instead of to the side ... step to the side ... --calib"),
            (Error::Mismatch("the sizes differ".into()), "the sizes differ"),
            (DeviceError::NoDriver.into(), "install the driver ... --device cpu"),
            (DeviceError::WrongMaps { name: name() }.into(), "update its driver ... --device cpu"),
            (too_large.into(), "9000 disparities ... --device cpu"),
            (failed.into(), "another --device ... --device cpu"),
            (machine(None, Purpose::Match).into(), "3.0 GiB ... a smaller --memory"),
            (machine(Some(1 << 20), Purpose::Match).into(), "1 MiB are free ... --set percentile"),
            (machine(None, Purpose::Image).into(), "3.0 GiB ... smaller image"),
            (on_device.into(), "2 MiB ... --device cpu ... smaller --memory"),
            (buffer.into(), "2 KiB ... --device cpu"),
            (MemoryError::Exhausted { name: name() }.into(), "--device cpu ... another --device"),
            (Error::Interrupted, "interrupted"),
        ]
    }

    const ROWS: Part = Part::Rows { first: 90, last: 179, of: 180 };

    /// Every warning, with the words that its message must contain in order.
    const WARNINGS: [(Warning, &str); 18] = [
        (Warning::Oriented { which: 2 }, "both images ... turn them upright with --orient"),
        (Warning::Identical, "give the right view"),
        (Warning::Plain { view: "left" }, "the left view"),
        (Warning::Masked { view: "right" }, "the right view is masked"),
        (Warning::HardlyMatch { percent: 7 }, "only 7 % ... rectified"),
        (Warning::LittleLeft { percent: 7, masked: 85 }, "only 7 % ... covers 85 % ... not the scene"),
        (Warning::Contrast { percent: 12 }, "12 %"),
        (Warning::Saturated { percent: [1, 37] }, ", or mask what is not image with --mask"),
        (Warning::Turned { how: "upside down" }, "upside down"),
        (Warning::NotRectified { offset: 512 }, "2.0 px ... row: add --rectify (and --calib FILE"),
        (Warning::Copied { part: Part::Whole }, "the same pixels everywhere ... wrote the images"),
        (
            Warning::Blurred { view: "right", part: ROWS },
            "the right view ... rows 90 to 179 of 180 ... in focus",
        ),
        (Warning::Torn { part: ROWS }, "in rows 90 to 179 of 180 ... torn"),
        (Warning::Swapped { percent: 97 }, "lower --min-disparity below 0"),
        (Warning::Clipped { end: 63, upper: true, percent: 9 }, ": raise --max-disparity"),
        (Warning::Clipped { end: -5, upper: false, percent: 9 }, ": lower --min-disparity"),
        (Warning::Contradicted { percent: 0 }, "contradict the prior ... not used ... of this scene"),
        (Warning::Contradicted { percent: 62 }, "contradict the prior in part ... 62 %"),
    ];

    /// Each message names the problem, the flag and the remedy in one line. Messages of the library name neither flags nor the program.
    #[test]
    fn every_cause_has_a_remedy() {
        let errors =
            every().into_iter().map(|(cause, words)| (cause.to_string(), error(&cause, &FLAGS), words));
        let warnings = WARNINGS.map(|(cause, words)| (cause.to_string(), warning(&cause, &FLAGS), words));
        for (plain, said, words) in errors.chain(warnings) {
            let mut rest = said.as_str();
            for word in words.split(" ... ") {
                let at = rest.find(word).unwrap_or_else(|| panic!("no {word}: {said}"));
                rest = &rest[at + word.len()..];
            }
            assert!(!said.contains('\n'), "{said}");
            assert!(!plain.contains("--") && !plain.contains("mrfgs") && !plain.contains('\n'), "{plain}");
        }
    }

    #[test]
    fn a_list_has_columns_and_not_their_flags() {
        let ranges = every().into_iter().filter(|(cause, _)| matches!(cause, Error::Range(_)));
        // If the pair itself is at fault, no range helps.
        let ranges = ranges
            .filter(|(cause, _)| !matches!(cause, Error::Range(RangeError::NotFound { cause: Some(_) })));
        let errors = ranges.map(|(cause, _)| error(&cause, &COLUMNS));
        let clipped = WARNINGS.iter().filter(|(cause, _)| matches!(cause, Warning::Clipped { .. }));
        let said: Vec<String> = errors.chain(clipped.map(|(cause, _)| warning(cause, &COLUMNS))).collect();
        assert_eq!(said.len(), 10);
        let without = |said: &str| !said.replace("add --rectify", "").contains("--");
        assert!(said.iter().all(|said| said.contains("_disparity") && without(said)), "{said:?}");
    }
}
