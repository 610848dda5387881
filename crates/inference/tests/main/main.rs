//! Tests of the inference through its public items.

mod relevance;
