//! A recovered response in the metadata of the field that was developed with it.

use relumine_field::ReflectanceField;
use relumine_radiometry::{ChannelFit, RecoveredResponse, Response, ResponseCurve};
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

/// A response that was recovered once, for a whole development.
pub(crate) struct KeptResponse {
    pub(crate) response: Response,
    pub(crate) report: [ChannelFit; 3],
}

/// As JSON holds it: rows of relative exposure, red, green, blue.
#[derive(Serialize, Deserialize)]
struct Record {
    rows: Vec<[f64; 4]>,
    fit: [ChannelFit; 3],
}

impl KeptResponse {
    /// Where `made` of a field has it.
    pub(crate) const KEY: &'static str = "recovered_response";

    pub(crate) fn new(recovered: &RecoveredResponse) -> Self {
        Self { response: recovered.response.clone(), report: recovered.report }
    }

    /// Of a value written by [`KeptResponse::to_json`]; `None` if it is not one.
    pub(crate) fn of(value: Value) -> Option<Self> {
        let record: Record = serde_json::from_value(value).ok()?;
        let curve = ResponseCurve::from_rows(&record.rows).ok()?;
        Some(Self { response: Response::Curve(curve), report: record.fit })
    }

    /// The one that a field was developed with.
    pub(crate) fn of_field(field: &ReflectanceField) -> Option<Self> {
        Self::of(field.header().made.get(Self::KEY)?.clone())
    }

    pub(crate) fn to_json(&self) -> Value {
        let rows = match &self.response {
            Response::Curve(curve) => curve.rows(),
            Response::Linear | Response::Srgb => Vec::new(),
        };
        json!(Record { rows, fit: self.report })
    }
}
