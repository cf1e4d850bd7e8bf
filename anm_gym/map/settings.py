"""Settings of the neural map: every number with its source; the defaults are the paper's."""

from dataclasses import asdict, dataclass
from hashlib import sha256
from json import dumps
from typing import Literal

from anm_gym.checks import check_at_least, check_choices, check_positive

DistanceTarget = Literal["ray", "normal", "batch", "cloud"]
KeyframeTest = Literal["render", "surface"]
PerturbationFamily = Literal["unit_norm", "delta_norm", "delta_weight", "laplace", "dropout"]
VariabilityStatistic = Literal["variance", "mean_absolute"]
Activation = Literal["softplus", "relu"]
PointEncoding = Literal["icosahedral", "axes"]
Replay = Literal["by_loss", "uniform", "none"]


@dataclass(frozen=True)
class GridSettings:
    """One resolution of a `DistanceGrid` (ours)."""

    voxel_m: float
    """Spacing of the corners, metres."""
    band_m: float
    """Observations with a larger absolute distance are left to coarser grids, metres."""
    noise_m: float
    """Standard deviation of one observation about the interpolated distance, metres."""
    prior_std_m: float
    """Standard deviation of what is predicted without this grid, metres."""
    max_evidence: float = 30.0
    """Observations after which a corner follows a moving average; 1 is a full observation at the corner."""
    behind_weight: float = 0.5
    """Evidence of an observation behind the surface, where thin things end; 1 in front of it."""

    def __post_init__(self) -> None:
        check_positive(self, "voxel_m", "band_m", "noise_m", "prior_std_m", "max_evidence")
        check_at_least(self, 0.0, "behind_weight")


@dataclass(frozen=True)
class FieldSettings:
    """Shape of the signed distance network.

    Source:
        Active Neural Mapping, Sec. 5.1 (4 hidden layers of 256); its released code has 6.
    """

    hidden_layers: int = 4
    """Hidden layers, an even number; the encoding joins again in the middle."""
    width: int = 256
    """Units of a hidden layer."""
    octaves: int = 6
    """Frequencies 2^0 … 2^(octaves - 1) of the icosahedral encoding."""
    point_scale_per_m: float = 0.05937489
    """Factor on the points before encoding, 1/m (released code)."""
    softplus_beta: float = 100.0
    """Sharpness of the softplus activations."""
    output_scale: float = 0.14
    """Factor on the network's output, metres (released code)."""
    activation: Activation = "softplus"
    """`relu` is the substitute of the paper's ablation (Module 4)."""
    encoding: PointEncoding = "icosahedral"
    """Directions of the encoding: iSDF's 21, or the three axes of the paper's ablation."""
    joins_encoding: bool = True
    """Whether the encoding joins again in the middle; it does not in the paper's ablation."""
    grids: tuple[GridSettings, ...] = ()
    """Grids that refine the network, coarse to fine (ours)."""
    dropout: float = 0.0
    """Share of the units dropped before each activation in training and in the draws of the `dropout`
    family; the paper's ablation has 0.05."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_positive(self, "point_scale_per_m", "softplus_beta", "output_scale")
        if not 0.0 <= self.dropout < 1.0:
            raise ValueError(f"`dropout` must be in [0, 1), got {self.dropout}")
        if self.hidden_layers < 4 or self.hidden_layers % 2:
            raise ValueError(f"`hidden_layers` must be an even number >= 4, got {self.hidden_layers}")
        check_at_least(self, 1, "width", "octaves")


@dataclass(frozen=True)
class SamplingSettings:
    """Which pixels and which points along their rays an iteration sees.

    Source:
        iSDF's sampling as used by Active Neural Mapping, Sec. 4.1.
    """

    window_frames: int = 5
    """Frames of one iteration: the two newest and replayed keyframes."""
    rays_per_frame: int = 200
    """Pixels drawn of each frame, uniform with replacement."""
    stratified: int = 19
    """Stratified samples of a ray between `min_depth_m` and just behind the surface."""
    near_surface: int = 8
    """Samples around the surface of a ray, the first exactly on it."""
    near_surface_std_m: float = 0.1
    """Spread of the near-surface samples, metres of depth."""
    behind_m: float = 0.1
    """How far behind the surface samples may lie, metres of depth."""
    min_depth_m: float = 0.07
    """Nearest valid depth, metres."""
    max_depth_m: float = 8.0
    """Farthest valid depth, metres."""
    fill_window: bool = False
    """Share out the rays of a full window while there are fewer frames (ours)."""
    fill_in_rays: int = 480
    """Pixels of the newest frame that are shown to the grids beside the iterations, where the finest
    grid knows least (ours)."""
    fill_in_candidates: int = 4
    """Pixels that are drawn for each such pixel."""
    replay: Replay = "by_loss"
    """Draw replayed keyframes in proportion to their last loss (iSDF), uniformly, or none at all."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_at_least(self, 3, "window_frames")
        check_at_least(self, 1, "rays_per_frame", "near_surface", "fill_in_candidates")
        check_at_least(self, 0, "stratified", "fill_in_rays")
        check_at_least(self, 0.0, "near_surface_std_m", "behind_m")
        if not 0.0 <= self.min_depth_m < self.max_depth_m:
            raise ValueError(
                "`min_depth_m` must be >= 0 and less than `max_depth_m`, "
                f"got {self.min_depth_m} and {self.max_depth_m}"
            )

    def rays_of_each(self, num_frames: int) -> int:
        """Pixels drawn of each frame of a window with `num_frames` frames."""
        if not self.fill_window:
            return self.rays_per_frame
        return max(self.rays_per_frame, self.rays_per_frame * self.window_frames // num_frames)

    @property
    def samples_per_ray(self) -> int:
        """Points of one ray."""
        return self.stratified + self.near_surface


@dataclass(frozen=True)
class LossSettings:
    """Weights of the three terms.

    Source:
        Active Neural Mapping, Eq. 3; the numbers are iSDF's.
    """

    distance_target: DistanceTarget = "ray"
    """How the supervising distance is bounded; see `anm_gym.map.losses.distance_bound`."""
    truncation_m: float = 0.29365
    """Below this bound the distance is regressed, above it only bounded, metres."""
    truncated_weight: float = 5.38344
    """Weight of the regressed distance."""
    free_space_decay: float = 5.0
    """Steepness of the penalty of negative predictions in free space, 1/m."""
    regress_free_space: bool = False
    """Regress the free-space distance too (ours; sound where the target is the observed cloud)."""
    eikonal_weight: float = 0.268
    """Weight of | ||gradient|| - 1 |."""
    eikonal_min_m: float = 0.1
    """The eikonal term acts where the bound is at least this, metres."""
    network_share: float = 1.0
    """Share of the rays that the network learns from; grids learn from all (ours)."""
    normal_weight: float = 0.018
    """Weight of 1 - cos(gradient, normal)."""
    gradient_share: float = 1.0
    """Share of the points that enter the two gradient terms (ours: less is faster)."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_positive(self, "truncation_m")
        check_at_least(self, 0.0, "truncated_weight", "free_space_decay", "normal_weight")
        check_at_least(self, 0.0, "eikonal_weight", "eikonal_min_m")
        if not 0.0 < self.gradient_share <= 1.0:
            raise ValueError(f"`gradient_share` must be in (0, 1], got {self.gradient_share}")
        if not 0.0 < self.network_share <= 1.0:
            raise ValueError(f"`network_share` must be in (0, 1], got {self.network_share}")


@dataclass(frozen=True)
class ScheduleSettings:
    """How often the optimiser steps.

    Source:
        Released code of Active Neural Mapping; the paper does not state the counts.
    """

    first_iterations: int = 200
    """Iterations at the first frame."""
    iterations: int = 10
    """Iterations at an ordinary frame."""
    keyframe_iterations: int = 60
    """Iterations when a keyframe is kept."""
    learning_rate: float = 0.0013
    """Step size of Adam."""
    weight_decay: float = 0.0
    """Decoupled weight decay; the paper's Adam has none, the released AdamW 0.012."""
    output_noise: float = 0.04
    """Standard deviation of the noise on the network's output before scaling, ordinary frame."""
    keyframe_output_noise: float = 0.08
    """The same when a keyframe is kept."""
    bfloat16: bool = False
    """Matrix products in bfloat16 (ours)."""

    def __post_init__(self) -> None:
        check_at_least(self, 0, "first_iterations", "iterations", "keyframe_iterations")
        check_at_least(self, 0.0, "weight_decay", "output_noise", "keyframe_output_noise")
        check_positive(self, "learning_rate")


@dataclass(frozen=True)
class KeyframeSettings:
    """When a frame is kept for replay.

    Source:
        iSDF's keyframe test as used by the released code.
    """

    test: KeyframeTest = "render"
    """`render` sphere-traces depth with a frozen copy; `surface` asks it at the seen points (ours)."""
    rays: int = 400
    """Rays of the test."""
    explained_share: float = 0.70
    """A smaller share of explained rays makes a keyframe."""
    relative_error: float = 0.1
    """Relative depth error under which a ray counts as explained."""
    max_interval: int = 100
    """Frames after which a keyframe is forced."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_at_least(self, 1, "rays", "max_interval")
        check_at_least(self, 0.0, "explained_share")
        check_positive(self, "relative_error")


@dataclass(frozen=True)
class VariabilitySettings:
    """How the weights are perturbed.

    Source:
        Active Neural Mapping, Sec. 4.2, Eq. 4; the Laplace family is ours.
    """

    family: PerturbationFamily = "delta_weight"
    """See `anm_gym.map.perturbation`."""
    draws: int = 20
    """Perturbed copies of the network."""
    statistic: VariabilityStatistic = "variance"
    """Variance of the predictions (paper) or mean absolute change (released code)."""
    prior_precision: float = 1.0
    """Precision of the last layer's Gaussian prior: a weight's prior standard deviation is `noise_m` over
    its root, in metres of output (Laplace family)."""
    noise_m: float = 0.05
    """Standard deviation of an observation about the network's prediction, metres (Laplace family)."""
    evidence_points: int = 4096
    """Replayed surface points that the Laplace posterior is fitted to."""

    def __post_init__(self) -> None:
        check_choices(self)
        check_at_least(self, 1, "draws", "evidence_points")
        check_positive(self, "prior_precision", "noise_m")


@dataclass(frozen=True)
class MapSettings:
    """All settings of a `NeuralMap`."""

    preset: str = "paper"
    """Name under which results are filed."""
    field: FieldSettings = FieldSettings()
    sampling: SamplingSettings = SamplingSettings()
    loss: LossSettings = LossSettings()
    schedule: ScheduleSettings = ScheduleSettings()
    keyframes: KeyframeSettings = KeyframeSettings()
    variability: VariabilitySettings = VariabilitySettings()
    reconstruction_std_m: float | None = None
    """The reconstruction leaves out zero-crossings whose posterior standard deviation is larger, metres
    (ours); None keeps all that lie near observed points, as the released code does."""

    def __post_init__(self) -> None:
        if self.reconstruction_std_m is not None:
            check_positive(self, "reconstruction_std_m")

    @property
    def settings_hash(self) -> str:
        """Twelve hexadecimal digits that name the effective settings."""
        return sha256(dumps(asdict(self), sort_keys=True).encode()).hexdigest()[:12]
