//! Checks a scene's tree against the published JSON schema, so that what the schema says and what is accepted are one.
//!
//! Only the keywords that occur in [`super::Scene::json_schema`] are read: `$ref`, `type`, `properties`, `required`,
//! `additionalProperties`, `items`, `minItems`, `maxItems`, `enum`, `const`, `oneOf`, `anyOf`, `minimum`, `maximum`.

use super::source::{Node, SceneError, Source, Value, join};
use serde_json::Value as Json;

/// The first place where `node` is not what `root` says.
pub(super) fn check(root: &Json, node: &Node, source: &Source) -> Result<(), SceneError> {
    Checker { root, source }.check(root, node, "")
}

struct Checker<'a> {
    root: &'a Json,
    source: &'a Source,
}

impl<'a> Checker<'a> {
    fn check(&self, schema: &'a Json, node: &Node, path: &str) -> Result<(), SceneError> {
        let schema = self.resolve(schema);
        if let Some(variants) = variants(schema) {
            return self.check_variants(schema, variants, node, path);
        }
        if let Some(choices) = Self::choices(schema) {
            return match &node.value {
                Value::String(s) if choices.contains(&s.as_str()) => Ok(()),
                Value::String(s) => {
                    Err(self.mismatch(schema, node, path).with_nearest(s, choices.into_iter()))
                }
                _ => Err(self.mismatch(schema, node, path)),
            };
        }
        match &node.value {
            Value::Table(entries) if allows(schema, "object") => {
                self.check_table(schema, entries, node, path)
            }
            Value::Array(items) if allows(schema, "array") => {
                let bound = |key: &str| schema.get(key).and_then(Json::as_u64).map(|n| n as usize);
                if bound("minItems").is_some_and(|n| items.len() < n)
                    || bound("maxItems").is_some_and(|n| items.len() > n)
                {
                    return Err(self.mismatch(schema, node, path));
                }
                match schema.get("items") {
                    Some(inner) => items
                        .iter()
                        .enumerate()
                        .try_for_each(|(i, item)| self.check(inner, item, &format!("{path}[{i}]"))),
                    None => Ok(()),
                }
            }
            Value::Null if allows(schema, "null") => Ok(()),
            Value::Bool(_) if allows(schema, "boolean") => Ok(()),
            Value::String(_) if allows(schema, "string") => Ok(()),
            Value::Integer(i) if allows(schema, "integer") || allows(schema, "number") => {
                let outside = |key: &str, low: bool| {
                    schema
                        .get(key)
                        .and_then(Json::as_f64)
                        .is_some_and(|bound| if low { (*i as f64) < bound } else { *i as f64 > bound })
                };
                if outside("minimum", true) || outside("maximum", false) {
                    return Err(self.mismatch(schema, node, path));
                }
                Ok(())
            }
            Value::Float(x) if allows(schema, "number") && x.is_finite() => Ok(()),
            _ => Err(self.mismatch(schema, node, path)),
        }
    }

    fn check_table(
        &self,
        schema: &'a Json,
        entries: &[(String, Node)],
        node: &Node,
        path: &str,
    ) -> Result<(), SceneError> {
        let properties = schema.get("properties").and_then(Json::as_object);
        for (key, value) in entries {
            match properties.and_then(|p| p.get(key)) {
                Some(inner) => self.check(inner, value, &join(path, key))?,
                None if schema.get("additionalProperties") == Some(&Json::Bool(false)) => {
                    let known: Vec<&str> =
                        properties.into_iter().flatten().map(|(k, _)| k.as_str()).collect();
                    let expected = format!("one of the keys {}", known.join(", "));
                    return Err(SceneError::new(
                        Some(self.source),
                        &join(path, key),
                        expected,
                        format!("the unknown key \"{key}\""),
                    )
                    .with_nearest(key, known.into_iter()));
                }
                None => {}
            }
        }
        for key in required(schema) {
            if !entries.iter().any(|(k, _)| k == key) {
                let inner = properties.and_then(|p| p.get(key)).map(|s| self.describe(s));
                return Err(self.at(
                    node,
                    &join(path, key),
                    inner.unwrap_or_else(|| "a value".into()),
                    "nothing (the key is missing)",
                ));
            }
        }
        Ok(())
    }

    /// One of several: by its tag, by its type, or by its keys.
    fn check_variants(
        &self,
        schema: &'a Json,
        variants: &'a [Json],
        node: &Node,
        path: &str,
    ) -> Result<(), SceneError> {
        // A value that may also be left out.
        let mut present = variants.iter().filter(|v| v.get("type") != Some(&Json::from("null")));
        if let (Some(only), None) = (present.next(), present.next())
            && node.value != Value::Null
        {
            return self.check(only, node, path);
        }
        let Value::Table(entries) = &node.value else {
            // Not a table: the variant that accepts it, else what all of them are.
            let accepts = variants.iter().any(|v| self.check(v, node, path).is_ok());
            if accepts {
                return Ok(());
            }
            let arrays: Vec<&Json> = variants.iter().filter(|v| allows(self.resolve(v), "array")).collect();
            return match (&node.value, arrays.as_slice()) {
                (Value::Array(_), [one]) => self.check(one, node, path),
                _ => Err(self.mismatch(schema, node, path)),
            };
        };
        if let Some(tag) = self.tag(variants) {
            let names: Vec<&str> = variants.iter().filter_map(|v| self.tag_value(v, tag)).collect();
            let key = join(path, tag);
            let expected = format!("one of {}", quoted(&names));
            return match entries.iter().find(|(k, _)| k == tag) {
                None => Err(self.at(node, &key, expected, "nothing (the key is missing)")),
                Some((_, Node { value: Value::String(name), .. })) => {
                    match variants.iter().find(|v| self.tag_value(v, tag) == Some(name)) {
                        Some(variant) => self.check(variant, node, path),
                        None => {
                            Err(SceneError::new(Some(self.source), &key, expected, format!("\"{name}\""))
                                .with_nearest(name, names.into_iter()))
                        }
                    }
                }
                Some((_, other)) => Err(self.at(other, &key, expected, other.describe())),
            };
        }
        let score = |v: &&Json| entries.iter().filter(|(k, _)| self.has_key(v, k)).count();
        let mut best: Option<(usize, &Json)> = None;
        for variant in variants.iter().filter(|v| self.is_table(v)) {
            let s = score(&variant);
            if best.is_none_or(|(b, _)| s > b) {
                best = Some((s, variant));
            }
        }
        match best {
            Some((s, variant)) if s > 0 || variants.iter().filter(|v| self.is_table(v)).count() == 1 => {
                self.check(variant, node, path)
            }
            _ => Err(self.mismatch(schema, node, path)),
        }
    }

    fn resolve(&self, schema: &'a Json) -> &'a Json {
        let Some(reference) = schema.get("$ref").and_then(Json::as_str) else { return schema };
        reference.strip_prefix('#').and_then(|pointer| self.root.pointer(pointer)).unwrap_or(schema)
    }

    /// Whether a table can be this: has properties, or variants that have.
    fn is_table(&self, schema: &'a Json) -> bool {
        let schema = self.resolve(schema);
        match variants(schema) {
            Some(list) => list.iter().any(|v| self.is_table(v)),
            None => allows(schema, "object"),
        }
    }

    fn has_key(&self, schema: &'a Json, key: &str) -> bool {
        let schema = self.resolve(schema);
        match variants(schema) {
            Some(list) => list.iter().any(|v| self.has_key(v, key)),
            None => schema.get("properties").is_some_and(|p| p.get(key).is_some()),
        }
    }

    /// The property that has a different constant in every variant.
    fn tag(&self, variants: &'a [Json]) -> Option<&'a str> {
        let first = self.resolve(variants.first()?).get("properties")?.as_object()?;
        first.keys().map(String::as_str).find(|key| variants.iter().all(|v| self.tag_value(v, key).is_some()))
    }

    fn tag_value(&self, variant: &'a Json, key: &str) -> Option<&'a str> {
        self.resolve(variant).get("properties")?.get(key)?.get("const")?.as_str()
    }

    /// The strings of an enumeration, written as `enum` or as one `const` per variant.
    fn choices(schema: &'a Json) -> Option<Vec<&'a str>> {
        if let Some(list) = schema.get("enum").and_then(Json::as_array) {
            return Some(list.iter().filter_map(Json::as_str).collect());
        }
        if let Some(value) = schema.get("const") {
            return Some(value.as_str().into_iter().collect());
        }
        let list = schema.get("oneOf")?.as_array()?;
        list.iter().map(Self::choices).collect::<Option<Vec<_>>>().map(|v| v.concat())
    }

    /// What the schema allows, in words.
    fn describe(&self, schema: &'a Json) -> String {
        let schema = self.resolve(schema);
        if let Some(choices) = Self::choices(schema) {
            return format!("one of {}", quoted(&choices));
        }
        if let Some(list) = variants(schema) {
            if let Some(tag) = self.tag(list) {
                let names: Vec<&str> = list.iter().filter_map(|v| self.tag_value(v, tag)).collect();
                return format!("a table with {tag} = {}", names.join(" | "));
            }
            let mut words: Vec<String> = list
                .iter()
                .filter(|v| v.get("type") != Some(&Json::from("null")))
                .map(|v| self.describe(v))
                .collect();
            words.dedup();
            return words.join(" or ");
        }
        if allows(schema, "object") {
            let keys: Vec<&str> = required(schema).collect();
            return if keys.is_empty() {
                "a table".into()
            } else {
                format!("a table with {}", keys.join(", "))
            };
        }
        if allows(schema, "array") {
            let items = schema.get("items").map_or_else(|| "values".into(), |s| self.describe(s));
            let count = |key: &str| schema.get(key).and_then(Json::as_u64);
            return match (count("minItems"), count("maxItems")) {
                (Some(low), Some(high)) if low == high => format!("an array of {low}, each {items}"),
                _ => format!("an array, each {items}"),
            };
        }
        if allows(schema, "integer") {
            return match schema.get("minimum").and_then(Json::as_f64) {
                Some(low) => format!("an integer ≥ {low}"),
                None => "an integer".into(),
            };
        }
        for (name, words) in
            [("number", "a finite number"), ("string", "a string"), ("boolean", "true or false")]
        {
            if allows(schema, name) {
                return words.into();
            }
        }
        "another type".into()
    }

    fn mismatch(&self, schema: &'a Json, node: &Node, path: &str) -> SceneError {
        self.at(node, path, self.describe(schema), node.describe())
    }

    /// An error at `node`, whose line is known even where `key` itself is missing.
    fn at(&self, node: &Node, key: &str, expected: impl Into<String>, got: impl Into<String>) -> SceneError {
        let mut error = SceneError::new(Some(self.source), key, expected, got);
        if node.line > 0 {
            error.line = Some(node.line);
        }
        error
    }
}

/// The alternatives of a schema, unless they are plain choices of a string.
fn variants(schema: &Json) -> Option<&[Json]> {
    let list = schema.get("anyOf").or_else(|| schema.get("oneOf"))?.as_array()?;
    let plain = list.iter().all(|v| v.get("const").is_some() || v.get("enum").is_some());
    (!plain).then_some(list)
}

fn allows(schema: &Json, name: &str) -> bool {
    match schema.get("type") {
        Some(Json::String(one)) => one == name,
        Some(Json::Array(list)) => list.iter().any(|t| t == name),
        _ => false,
    }
}

fn required(schema: &Json) -> impl Iterator<Item = &str> {
    schema.get("required").and_then(Json::as_array).into_iter().flatten().filter_map(Json::as_str)
}

fn quoted(names: &[&str]) -> String {
    names.iter().map(|n| format!("\"{n}\"")).collect::<Vec<_>>().join(", ")
}
