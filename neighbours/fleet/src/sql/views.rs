//! Views of what people ask.
//!
//! Their text is SQL that other engines take as well (`probecell-fleet views`); tests compare the answers with DuckDB's.

/// A view.
#[derive(Debug, Clone, Copy)]
pub struct View {
    /// Name.
    pub name: &'static str,
    /// What a row is.
    pub description: &'static str,
    /// The query.
    pub query: &'static str,
}

impl View {
    /// The statement that makes it.
    pub fn statement(&self) -> String {
        format!("CREATE VIEW {} AS\n{}", self.name, self.query)
    }
}

/// All views.
pub const VIEWS: &[View] = &[
    View {
        name: "capability",
        description: "a feature of a machine in a month: mean, standard deviation and performance indices Pp and Ppk \
                      (ISO 22514-2) of its size, as it was last measured on each part",
        query: CAPABILITY,
    },
    View {
        name: "causes",
        description: "an effect of a machine type: in how many sessions and on how many machines the diagnosis names it, and \
                      what it takes from the gap; rank 1 is the most frequent of its type",
        query: CAUSES,
    },
    View {
        name: "promised_and_achieved",
        description: "an effect of the declared model of a machine: promised and achieved reduction of the gap, and in what \
                      share of the sessions the promise was kept",
        query: PROMISED_AND_ACHIEVED,
    },
    View {
        name: "corrections_that_did_not_help",
        description: "a correction that was applied and left an error as large as before or larger: excess is by how much, \
                      significant where that is beyond what the uncertainty explains (k = 2)",
        query: CORRECTIONS_THAT_DID_NOT_HELP,
    },
];

const CAPABILITY: &str = "\
WITH measured AS (
  SELECT *, row_number() OVER (PARTITION BY bag, part_id, feature_id ORDER BY \"time\" DESC) AS age
  FROM features
  WHERE size_deviation IS NOT NULL AND decision <> 'invalid' AND NOT coalesce(by_reference, false)
)
SELECT machine_type, machine, feature_id, \"month\", lower_tolerance, upper_tolerance,
  count(*) AS parts,
  sum(CASE WHEN decision = 'does_not_conform' THEN 1 ELSE 0 END) AS not_conforming,
  avg(size_deviation) AS mean_deviation,
  stddev_samp(size_deviation) AS standard_deviation,
  avg(expanded_uncertainty) AS expanded_uncertainty,
  (upper_tolerance - lower_tolerance) / (6 * nullif(stddev_samp(size_deviation), 0)) AS pp,
  least(upper_tolerance - avg(size_deviation), avg(size_deviation) - lower_tolerance)
    / (3 * nullif(stddev_samp(size_deviation), 0)) AS ppk
FROM measured
WHERE age = 1
GROUP BY machine_type, machine, feature_id, \"month\", lower_tolerance, upper_tolerance";

const CAUSES: &str = "\
WITH diagnosed AS (
  SELECT machine_type, count(*) AS diagnosed
  FROM sessions
  WHERE verdict IS NOT NULL
  GROUP BY machine_type
), named AS (
  SELECT machine_type, effect,
    count(DISTINCT bag) AS sessions,
    count(DISTINCT machine) AS machines,
    median(rms_before - rms_after) AS median_reduction,
    avg(probability) AS mean_probability,
    min(\"time\") AS first_named,
    max(\"time\") AS last_named
  FROM effects
  WHERE named AND \"number\" = 0
  GROUP BY machine_type, effect
)
SELECT named.machine_type,
  rank() OVER (PARTITION BY named.machine_type ORDER BY sessions DESC) AS \"rank\",
  effect, sessions, diagnosed AS sessions_diagnosed, machines, median_reduction, mean_probability, first_named, last_named
FROM named JOIN diagnosed ON named.machine_type = diagnosed.machine_type";

const PROMISED_AND_ACHIEVED: &str = "\
SELECT machine_type, machine, effect, source,
  count(*) AS sessions,
  avg(promised_before - promised_after) AS promised_reduction,
  avg(achieved_before - achieved_after) AS achieved_reduction,
  avg(achieved_after) AS gap_left,
  avg(CASE WHEN kept THEN 1.0 WHEN NOT kept THEN 0.0 END) AS share_kept,
  min(\"time\") AS first_session,
  max(\"time\") AS last_session
FROM promises
GROUP BY machine_type, machine, effect, source";

const CORRECTIONS_THAT_DID_NOT_HELP: &str = "\
SELECT machine_type, machine, bag, \"time\", correction_id, kind, feature_ids, approval,
  error_before, error_after, standard_uncertainty,
  abs(error_after) - abs(error_before) AS excess,
  abs(error_after) - abs(error_before) > 2 * sqrt(2) * standard_uncertainty AS significant
FROM corrections
WHERE outcome IN ('applied', 'already_applied') AND abs(error_after) >= abs(error_before)";
