// The JSON documents that the page draws, as server/ctl/OUTPUT.md describes them: SI, null for what is not known. Only fields
// that are read here are named. A field that an older server does not send is `undefined`: say `?`.

export type Maybe = number | null;

export interface Status {
  campaign: string;
  name: string;
  state: "queued" | "running" | "paused" | "finished" | "failed" | "cancelled";
  reason: string;
  phase: string;
  method: string;
  iteration: number;
  max_iterations: number;
  samples: number;
  samples_done: number;
  samples_running: number;
  samples_resting: number;
  samples_stopped_early: number;
  samples_diverged: number;
  samples_unknown: number;
  effective_sample_size: Maybe;
  best_misfit: Maybe;
  eta_seconds: Maybe;
  states_per_second?: Maybe;
  model_evaluations: number;
  core_hours: number;
  converged: boolean;
  created_unix_ms: number;
  owner: string | null;
  priority?: number;
  parent: string | null;
  purpose: string | null;
  effects: string[];
  problem: string | null;
  nobody_may_run_it: string | null;
  server_waits: string | null;
}

export interface Shown extends Status {
  warnings: string[];
  children: { campaign: string; purpose: string; name: string; state: Status["state"] }[];
  findings: { kind: string; digest: string; created_unix_ms: number }[];
  next_command?: string | null;
}

export interface LineageNode {
  campaign: string;
  name: string;
  state: Status["state"];
  purpose: string | null;
  parent: string | null;
  effects: string[];
}

export interface Lineage {
  campaign: string;
  nodes: LineageNode[];
}

/// Pairs of a parameter's value and a probability density per unit of it.
export type Density = [number, number][];

export interface Parameter {
  mean: Maybe;
  sd: Maybe;
  cov: Maybe;
  q05: Maybe;
  q50: Maybe;
  q95: Maybe;
  unit: string;
  at_bound: boolean;
  prior_min: Maybe;
  prior_max: Maybe;
  conditioned_on: boolean;
  member?: boolean; // the value of one label, which follows from others: none in correlation and path
  prior_density?: Density | null;
  density?: Density | null;
}

export interface PathPoint {
  experiment: string;
  load_step: number;
  mean: Maybe[];
  cov: Maybe[];
  ess: Maybe;
}

export interface ErrorSize { mean: Maybe; sd: Maybe; q05: Maybe; q50: Maybe; q95: Maybe }

/// Of runs that were chosen together. expected_gain: part of the uncertainty, 0 to 1.
export interface PlacedBatch {
  runs: number;
  expected_gain: number;
}

export interface Posterior {
  batches?: PlacedBatch[];
  campaign: string;
  iteration: number | null;
  iterations: number | null;
  converged: boolean | null;
  log_evidence: Maybe;
  log_evidence_se: Maybe;
  parameters: Record<string, Parameter>;
  nuisance_parameters?: Record<string, Parameter>; // inferred, not among the wanted; behind them in correlation and path
  correlation: number[][];
  ess: Maybe;
  posterior_from: string | null;
  predictive_p: Maybe;
  model_error?: { observables: string[]; relative?: ErrorSize; absolute?: ErrorSize }[];
  noise_scale?: { observables: string[]; q05: Maybe; q50: Maybe; q95: Maybe }[];
  path: PathPoint[];
  draws?: { parameters: string[]; values: number[][] } | null;
  warnings: string[];
}

export interface Bands {
  mean: Maybe[];
  q025: Maybe[] | null;
  q05: Maybe[] | null;
  q25: Maybe[] | null;
  q50: Maybe[] | null;
  q75: Maybe[] | null;
  q95: Maybe[] | null;
  q975: Maybe[] | null;
}

/// A run among those that are drawn: rank 1 is the best that has finished, null one that has not.
export interface Run {
  sample: number;
  rank: number | null;
  status: string;
  weight: Maybe;
  log_likelihood: Maybe;
}

export interface FittedObservable {
  name: string;
  unit: string;
  values: Maybe[];
  sd: Maybe[];
  total_sd: Maybe[];
  bands: Bands | null;
  residual: Maybe[] | null;
  runs: Maybe[][]; // one row per run of the experiment
}

export type Role = "calibrate" | "validate";

export interface FittedExperiment {
  experiment: string;
  test: string;
  role: Role;
  settings: Record<string, { value: number; unit: string }>;
  control: string;
  control_unit: string;
  control_values: number[];
  segments: string[];
  runs: Run[];
  observables: FittedObservable[];
}

export interface MisfitRow {
  experiment: string;
  observable: string;
  segment?: string;
  rms_error: Maybe;
  bias?: Maybe;
  z: Maybe;
  p_value: Maybe;
  readings: number;
  role: Role;
}

export interface PartialFit {
  experiment: string;
  segment: string | null;
  mean: Maybe;
  sd: Maybe;
  z: Maybe;
}

export interface Drift {
  parameter: string;
  unit: string;
  p_experiments: Maybe;
  p_segments: Maybe;
  trend: { with: string; per_decade: number; sd: number } | null;
  fits: PartialFit[];
}

export interface Comparison {
  campaign: string;
  where_it_fails?: string[];
  rms_error: Maybe;
  reduced_chi2: Maybe;
  p_value: Maybe;
  heldout_rms_error: Maybe;
  by_observable: MisfitRow[];
  by_segment: (MisfitRow & { segment: string })[];
  parameter_drift: Drift[];
  at_bound: string[];
  warnings: string[];
  note: string;
  experiments?: FittedExperiment[];
}

export interface Candidate {
  effect: string;
  probability: Maybe;
  probability_sd: Maybe;
  alone: boolean;
  p_value: Maybe;
  explained_fraction: Maybe;
  amplitude: Record<string, Maybe>;
  predicted_rms_error: Maybe;
  confusable_with: string[];
  curves: { experiment: string; observable: string; change: Maybe[] }[];
}

export interface NextExperiment {
  test: string;
  repeat_of: string | null;
  expected_power: Maybe;
  forecast: { decides: Maybe; names_wrong: Maybe } | null;
  in_words: string;
  snippet: string;
}

export interface Diagnosis {
  campaign: string;
  verdict: string;
  sentence: string;
  in_doubt: boolean;
  warnings: string[];
  effects: string[];
  probabilities?: { effects: string[]; probability: number }[]; // of earlier builds and of the adequacy alone there are none
  none_of_these?: Maybe;
  credible_set?: string[][];
  families?: { effects: string[]; probability: number }[];
  candidates: Candidate[];
  detectable?: Record<string, Record<string, Maybe>>;
  undetectable?: { effect: string; reason: string }[];
  not_excitable?: { effect: string; reason: string }[];
  units: Record<string, string>;
  next_experiment?: NextExperiment | null;
  only_adequacy?: boolean;
  adequacy: { p_value: Maybe; rms: Maybe; packings: Maybe };
}

export interface ImprovementStep {
  campaign: string;
  effects: string[];
  probability: Maybe;
  rms_error: Maybe;
  heldout_rms_error: Maybe;
  verdict: string | null;
  reason: string;
}

export interface Improvement {
  verdict: string;
  final_campaign: string;
  steps: ImprovementStep[];
}

export interface Worker {
  name: string;
  slots: number;
  busy: number;
  contact_updates_per_second: number;
  cpu: string;
  draining: boolean;
  connected: boolean;
  left: boolean;
  waits: string | null;
  seconds_since_heard: number;
  running: string[];
  engine_version: string;
}

export interface Sample {
  index: number;
  iteration: number;
  parameters: Record<string, number>;
  status: string;
  reason: string;
  weight: Maybe;
  log_likelihood: Maybe;
  attempts: number;
  purpose: string | null;
}

export interface Samples {
  campaign: string;
  samples: Sample[];
}

export interface Grains {
  campaign: string;
  sample: number;
  experiment: string;
  load_step: number;
  load_steps: number[];
  cell: { min: number[]; max: number[] };
  grains: { x: number[]; y: number[]; z: number[]; radius: number[]; speed: number[]; coordination: number[] };
  contacts: { i: number[]; j: number[]; normal_force: number[] };
}

export interface Iteration {
  iteration: number;
  ess: Maybe;
  pareto_k: Maybe;
  log_evidence: Maybe;
  log_evidence_se: Maybe;
  model_evaluations: number;
  parameters: { [name: string]: { mean: Maybe; q05: Maybe; q95: Maybe; unit: string } };
}

/// What was done. Of a report.
export interface Made {
  campaign: string;
  entries: [term: string, text: string][];
  files: { path: string; sha256: string }[];
  campaign_file: string;
  iterations: Iteration[];
  methods: { sentences: string[]; references: string[] };
  latex: string;
}

type ByParameter<T> = { [parameter: string]: T } | null;

export interface MovedQuantity {
  experiment: string;
  quantity: string;
  unit: string;
  runs: number;
  explained: Maybe;
  total: ByParameter<{ index: Maybe; error: Maybe }>; // null where the priors are tied
  prior: { correlation: ByParameter<{ rank: Maybe; error: Maybe }> };
  posterior: { correlation: ByParameter<{ rank: Maybe; error: Maybe }> } | null;
}

export interface Sensitivity {
  campaign: string;
  parameters: string[];
  independent: boolean;
  quantities: MovedQuantity[];
  left_out: string[];
}
