//! Where each key of a scene was read, and the error that says so.

use std::collections::BTreeMap;
use std::fmt;

/// A value that is not what it should be: where it stands, what was expected, what came.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SceneError {
    /// The scene file, if the scene was read from one.
    pub file: Option<String>,
    /// Line in the file, from 1.
    pub line: Option<usize>,
    /// Path of the key, such as `cloth[0].pins[1].vertices[2]`; empty for the whole file.
    pub key: String,
    /// What was expected, with the unit.
    pub expected: String,
    /// What came.
    pub got: String,
    /// The nearest known name, where a name was not known.
    pub nearest: Option<String>,
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{file}:")?;
            if let Some(line) = self.line {
                write!(f, "{line}:")?;
            }
            write!(f, " ")?;
        }
        let key = if self.key.is_empty() { "scene" } else { &self.key };
        write!(f, "{key}: expected {}, got {}", self.expected, self.got)?;
        match &self.nearest {
            Some(nearest) => write!(f, " (did you mean \"{nearest}\"?)"),
            None => Ok(()),
        }
    }
}

impl std::error::Error for SceneError {}

impl SceneError {
    pub(super) fn new(
        source: Option<&Source>,
        key: &str,
        expected: impl Into<String>,
        got: impl Into<String>,
    ) -> Self {
        Self {
            file: source.and_then(|s| s.file.clone()),
            line: source.and_then(|s| s.line(key)),
            key: bearable(key.into()),
            expected: expected.into(),
            got: bearable(got.into()),
            nearest: None,
        }
    }

    /// The same with the nearest of the `known` names to what came, if one is near.
    #[must_use]
    pub(crate) fn with_nearest<'a>(mut self, got: &str, known: impl Iterator<Item = &'a str>) -> Self {
        self.nearest = nearest(got, known);
        self
    }
}

/// A text of a message; what came can be a megabyte of a damaged file.
fn bearable(text: String) -> String {
    const MOST: usize = 300;
    match text.char_indices().nth(MOST) {
        Some((at, _)) => format!("{}… ({} bytes more)", &text[..at], text.len() - at),
        None => text,
    }
}

/// The known name that is fewest edits away, if that is at most a third of its length (at least two edits).
pub fn nearest<'a>(got: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    // The distance takes time and room of the product of both lengths.
    const LONGEST: usize = 100;
    if got.len() > LONGEST {
        return None;
    }
    known
        .map(|name| (strsim::damerau_levenshtein(got, name), name))
        .min()
        .filter(|(distance, name)| *distance <= (name.chars().count() / 3).max(2))
        .map(|(_, name)| name.into())
}

/// File name and lines of all keys.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Source {
    pub(super) file: Option<String>,
    pub(super) lines: BTreeMap<String, usize>,
}

impl Source {
    /// Line of `key`, else of the innermost table or array around it.
    fn line(&self, key: &str) -> Option<usize> {
        let mut key = key;
        loop {
            if let Some(&line) = self.lines.get(key) {
                return Some(line);
            }
            key = &key[..key.rfind(['.', '['])?];
        }
    }
}

/// A value of a scene file and the line it starts on (0: not known).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Node {
    pub(super) value: Value,
    pub(super) line: usize,
}

/// TOML's and JSON's values in one.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Null,
    Bool(bool),
    Integer(i64),
    Float(f64),
    String(String),
    Array(Vec<Node>),
    Table(Vec<(String, Node)>),
    /// A TOML date or a number out of range: a type that no key has.
    Other(String),
}

impl Node {
    pub(super) fn from_toml(
        value: &toml::de::DeValue<'_>,
        line: usize,
        line_of: &dyn Fn(usize) -> usize,
    ) -> Self {
        use toml::de::DeValue;
        let value = match value {
            DeValue::Boolean(b) => Value::Bool(*b),
            DeValue::String(s) => Value::String(s.clone().into_owned()),
            DeValue::Integer(i) => i64::from_str_radix(i.as_str(), i.radix())
                .map_or_else(|_| Value::Other(i.to_string()), Value::Integer),
            DeValue::Float(x) => {
                x.as_str().parse().map_or_else(|_| Value::Other(x.to_string()), Value::Float)
            }
            DeValue::Datetime(d) => Value::Other(d.to_string()),
            DeValue::Array(items) => Value::Array(
                items
                    .iter()
                    .map(|v| Self::from_toml(v.get_ref(), line_of(v.span().start), line_of))
                    .collect(),
            ),
            DeValue::Table(table) => Value::Table(
                table
                    .iter()
                    .map(|(key, v)| {
                        let line = line_of(key.span().start);
                        (key.get_ref().clone().into_owned(), Self::from_toml(v.get_ref(), line, line_of))
                    })
                    .collect(),
            ),
        };
        Self { value, line }
    }

    pub(super) fn from_json(value: serde_json::Value) -> Self {
        let value = match value {
            serde_json::Value::Null => Value::Null,
            serde_json::Value::Bool(b) => Value::Bool(b),
            serde_json::Value::Number(n) => match (n.as_i64(), n.as_f64()) {
                (Some(i), _) => Value::Integer(i),
                (None, Some(x)) => Value::Float(x),
                _ => Value::Other(n.to_string()),
            },
            serde_json::Value::String(s) => Value::String(s),
            serde_json::Value::Array(items) => Value::Array(items.into_iter().map(Self::from_json).collect()),
            serde_json::Value::Object(map) => {
                Value::Table(map.into_iter().map(|(k, v)| (k, Self::from_json(v))).collect())
            }
        };
        Self { value, line: 0 }
    }

    /// JSON of values that have passed the schema (so that no number is NaN or infinite).
    pub(super) fn to_json(&self) -> serde_json::Value {
        match &self.value {
            Value::Null | Value::Other(_) => serde_json::Value::Null,
            Value::Bool(b) => (*b).into(),
            Value::Integer(i) => (*i).into(),
            Value::Float(x) => (*x).into(),
            Value::String(s) => s.as_str().into(),
            Value::Array(items) => items.iter().map(Self::to_json).collect(),
            Value::Table(entries) => entries.iter().map(|(k, v)| (k.clone(), v.to_json())).collect(),
        }
    }

    /// What came, in words.
    pub(super) fn describe(&self) -> String {
        match &self.value {
            Value::Null => "null".into(),
            Value::Bool(b) => b.to_string(),
            Value::Integer(i) => i.to_string(),
            Value::Float(x) => format!("{x:?}"),
            Value::String(s) => format!("\"{s}\""),
            Value::Array(items) => format!("an array of {}", items.len()),
            Value::Table(_) => "a table".into(),
            Value::Other(text) => text.clone(),
        }
    }

    /// Lines of this node's keys, under `path`.
    pub(super) fn collect_lines(&self, path: &str, lines: &mut BTreeMap<String, usize>) {
        lines.insert(path.into(), self.line);
        match &self.value {
            Value::Array(items) => {
                for (i, item) in items.iter().enumerate() {
                    item.collect_lines(&format!("{path}[{i}]"), lines);
                }
            }
            Value::Table(entries) => {
                for (key, value) in entries {
                    value.collect_lines(&join(path, key), lines);
                }
            }
            _ => {}
        }
    }
}

/// `path.key`, or `key` at the top.
pub(super) fn join(path: &str, key: &str) -> String {
    if path.is_empty() { key.into() } else { format!("{path}.{key}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_near() {
        let known = || ["mesh", "material", "rest", "warp"].into_iter();
        assert_eq!(nearest("materiel", known()), Some("material".into()));
        assert_eq!(nearest("wrap", known()), Some("warp".into()));
        assert_eq!(nearest("bananas", known()), None);
    }

    #[test]
    fn a_line_is_found_for_keys_within() {
        let lines = [(String::new(), 1), ("cloth[0]".into(), 4), ("cloth[0].pins".into(), 9)].into();
        let source = Source { file: Some("a.toml".into()), lines };
        assert_eq!(source.line("cloth[0].pins[3].vertices[1]"), Some(9));
        assert_eq!(source.line("cloth[0].mesh"), Some(4));
        assert_eq!(source.line("nothing"), None);
    }
}
