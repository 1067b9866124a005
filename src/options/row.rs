//! Declares options: one row holds the key, type, default, range, unit, source and meaning of an option. The
//! field of the group's struct with its documentation, the validation, the listing of `mrfgs presets`, config
//! files and Python's documentation all follow from that row.

use crate::error::OptionError;
use serde::Serialize;
use std::fmt;
use std::ops::RangeInclusive;

/// A group of options, which are the fields of one struct.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// The name, which is the heading in a config file: `cost`.
    pub name: &'static str,
    /// The subject of its options.
    pub meaning: &'static str,
    /// Its options, in order.
    pub keys: &'static [Key],
}

/// An option, as declared by its row.
#[derive(Clone, Copy, Debug)]
pub struct Key {
    /// The name of the field.
    pub(super) field: &'static str,
    /// The values that it takes.
    pub takes: Takes,
    /// The unit of its values; empty if they have none.
    pub unit: &'static str,
    /// The meaning of the option.
    pub meaning: &'static str,
    /// The source: a section of the paper, with the paper's value, or other work. `open` means that the paper
    /// leaves the choice open.
    pub source: &'static str,
    /// Whether the option only reproduces other readings of the paper; lists leave these out unless asked.
    pub for_reproduction: bool,
}

impl Key {
    /// The name, unique among all groups: `sad-window`.
    #[must_use]
    pub fn name(&self) -> String {
        self.field.replace('_', "-")
    }

    /// Why `value` is invalid, if it is; `shown` is how it is quoted.
    pub(super) fn check(&self, value: Value, shown: impl FnOnce() -> String) -> Result<(), OptionError> {
        let outside = |value: f64, low: f64, high: f64| Err(OptionError::OutOfRange { value, low, high });
        match (self.takes, value) {
            (Takes::Whole { low, high, .. }, Value::Whole(v)) if v < low.into() || v > high.into() => {
                outside(v as f64, low.into(), high.into())
            }
            (Takes::Whole { odd: true, .. }, Value::Whole(v)) if v % 2 == 0 => {
                Err(OptionError::NotOdd { value: v as u32 })
            }
            // NaN is outside every range.
            (Takes::Real { low, high }, Value::Real(v)) if !(low..=high).contains(&v) => {
                outside(v, low, high)
            }
            (Takes::Switch, Value::Switch)
            | (Takes::Whole { .. }, Value::Whole(_))
            | (Takes::Real { .. }, Value::Real(_)) => Ok(()),
            (Takes::Words(words), Value::Word(word)) if words.iter().any(|w| w.word == word) => Ok(()),
            _ => Err(OptionError::WrongKind {
                expected: self.to_string(),
                found: crate::text::one_line(&shown()),
            }),
        }
    }
}

/// Shows the unit and the range: `pixels, odd, 1 to 31`.
impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match (self.unit, self.takes) {
            ("", takes) => write!(f, "{takes}"),
            (unit, takes @ Takes::Whole { odd: true, .. }) => write!(f, "{unit}, odd, {takes}"),
            (unit, takes) => write!(f, "{unit}, {takes}"),
        }
    }
}

/// A value of a key, as far as its range concerns it.
#[derive(Clone, Copy, Debug)]
pub(super) enum Value<'a> {
    /// True or false.
    Switch,
    /// A word.
    Word(&'a str),
    /// A whole number.
    Whole(i64),
    /// A real number.
    Real(f64),
    /// A value of a type that no option has.
    #[cfg(feature = "files")]
    Other,
}

/// A type of a field.
pub(super) trait Stored: Copy {
    /// The contained value.
    fn value(self) -> Value<'static>;
}

impl Stored for bool {
    fn value(self) -> Value<'static> {
        Value::Switch
    }
}

impl Stored for u32 {
    fn value(self) -> Value<'static> {
        Value::Whole(self.into())
    }
}

impl Stored for f64 {
    fn value(self) -> Value<'static> {
        Value::Real(self)
    }
}

/// The values that a key takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Takes {
    /// True or false.
    Switch,
    /// One of some words.
    Words(&'static [Word]),
    /// A whole number.
    Whole {
        /// The smallest.
        low: u32,
        /// The largest.
        high: u32,
        /// Whether it must be odd.
        odd: bool,
    },
    /// A real number.
    Real {
        /// The smallest.
        low: f64,
        /// The largest.
        high: f64,
    },
}

/// Shows the range: `1 to 31`.
impl fmt::Display for Takes {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Switch => f.write_str("true | false"),
            Self::Words(words) => {
                f.write_str(&words.iter().map(|word| word.word).collect::<Vec<_>>().join(" | "))
            }
            Self::Whole { low, high, .. } => write!(f, "{low} to {high}"),
            Self::Real { low, high } => write!(f, "{low} to {high}"),
        }
    }
}

/// A whole number within `range`.
pub(super) const fn whole(range: RangeInclusive<u32>) -> Takes {
    Takes::Whole { low: *range.start(), high: *range.end(), odd: false }
}

/// An odd number within `range`.
pub(super) const fn odd(range: RangeInclusive<u32>) -> Takes {
    Takes::Whole { low: *range.start(), high: *range.end(), odd: true }
}

/// A real number within `range`.
pub(super) const fn real(range: RangeInclusive<f64>) -> Takes {
    Takes::Real { low: *range.start(), high: *range.end() }
}

/// One of some words.
pub(super) const fn one_of(words: &'static [Word]) -> Takes {
    Takes::Words(words)
}

/// A word that an option takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Word {
    /// The word as users write it: `ad-census`.
    pub word: &'static str,
    /// The meaning of the word.
    pub meaning: &'static str,
}

/// Declares a group of options: a struct with a field per row, its defaults, and its description `GROUP`.
///
/// A row reads: `/// meaning`, then `key: type = default, takes range, unit "..." (if any), source "...";`. A
/// final `for reproduction` marks an option that only serves to reproduce other readings of the paper. A row with
/// `#[cfg(...)]` after its meaning is there with a feature alone.
macro_rules! options {
    (
        $(#[doc = $about:literal])+
        $name:literal $group:ident {
            $(
                $(#[doc = $meaning:literal])+
                $(#[cfg($($when:tt)+)])?
                $field:ident: $type:ty = $default:expr, takes $takes:expr, $(unit $unit:literal,)? source $source:literal
                    $(, for $purpose:ident)?;
            )+
        }
    ) => {
        $(#[doc = $about])+
        #[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
        #[serde(rename_all = "kebab-case", deny_unknown_fields)]
        #[non_exhaustive]
        pub struct $group {
            $(
                $(#[doc = $meaning])+
                ///
                #[doc = concat!("Range: `", stringify!($takes), "`" $(, " ", $unit)?, ".")]
                #[doc = concat!("Default: `", stringify!($default), "`.")]
                #[doc = concat!("Source: ", $source, ".")]
                $(#[cfg($($when)+)])?
                pub $field: $type,
            )+
        }

        impl Default for $group {
            fn default() -> Self {
                Self { $( $(#[cfg($($when)+)])? $field: $default, )+ }
            }
        }

        impl $group {
            /// The rows.
            pub const GROUP: $crate::options::Group = $crate::options::Group {
                name: $name,
                meaning: concat!($($about),+).trim_ascii(),
                keys: &[ $(
                    $(#[cfg($($when)+)])?
                    $crate::options::Key {
                        field: stringify!($field),
                        takes: $takes,
                        unit: concat!($($unit)?),
                        meaning: concat!($($meaning),+).trim_ascii(),
                        source: $source,
                        for_reproduction: !concat!($(stringify!($purpose))?).is_empty(),
                    },
                )+ ],
            };

            /// Finds the first key that is out of its range.
            pub(super) fn check_each(&self) -> Result<(), (String, $crate::error::OptionError)> {
                use $crate::options::row::Stored;
                let values = [ $( $(#[cfg($($when)+)])? self.$field.value(), )+ ];
                for (key, value) in Self::GROUP.keys.iter().zip(values) {
                    key.check(value, || format!("{value:?}")).map_err(|cause| (key.name(), cause))?;
                }
                Ok(())
            }
        }
    };
}

/// Declares the words of an option: an enum with a variant per word, and their descriptions `WORDS`.
macro_rules! words {
    (
        $(#[doc = $about:literal])+
        $name:ident {
            $(
                $(#[doc = $meaning:literal])+
                $variant:ident = $word:literal,
            )+
        }
    ) => {
        $(#[doc = $about])+
        #[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
        pub enum $name {
            $(
                $(#[doc = $meaning])+
                #[serde(rename = $word)]
                $variant,
            )+
        }

        impl $name {
            /// All words.
            pub const ALL: &[Self] = &[ $( Self::$variant, )+ ];

            /// The words, as users write them.
            pub const WORDS: &[$crate::options::Word] = &[ $(
                $crate::options::Word { word: $word, meaning: concat!($($meaning),+).trim_ascii() },
            )+ ];
        }

        impl $crate::options::row::Stored for $name {
            fn value(self) -> $crate::options::row::Value<'static> {
                $crate::options::row::Value::Word(match self { $( Self::$variant => $word, )+ })
            }
        }
    };
}

pub(super) use {options, words};
