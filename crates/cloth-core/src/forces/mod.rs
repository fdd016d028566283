//! Force models.

/// What is done about the indefinite part of Hessian blocks.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum Psd {
    /// Exact second derivatives, possibly indefinite.
    Raw,
    /// Each element's block made positive semi-definite in closed form.
    #[default]
    Projected,
}
