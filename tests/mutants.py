"""Deliberate errors, one a line or two, and the test that must notice each.

``tests/test_mutants.py`` copies the package, plants one, runs the named test and expects it to fail.
Add a mutant whenever you write a line whose loss would change a result in silence.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Mutant:
    """One planted error: in ``file`` (below src/inbounds), ``old`` becomes ``new``; ``test`` must fail."""

    name: str
    file: str
    old: str
    new: str
    test: str


MUTANTS: tuple[Mutant, ...] = (
    Mutant(
        "the Jacobian is dropped",
        "distributions/logit_normal.py",
        "log_density = self._normal().log_prob(latent) + log_jacobian",
        "log_density = self._normal().log_prob(latent)",
        "tests/distributions/test_logit_normal.py::test_density_integrates_to_one",
    ),
    Mutant(
        "the Jacobian has the wrong sign",
        "distributions/logit_normal.py",
        "return self._normal().log_prob(latent) - _log_slope(latent) - self.width.log()",
        "return self._normal().log_prob(latent) + _log_slope(latent) - self.width.log()",
        "tests/distributions/test_logit_normal.py::test_latent_density_is_the_density",
    ),
    Mutant(
        "the entropy forgets the interval's length",
        "distributions/logit_normal.py",
        "return self._normal().entropy() + self.width.log() + self._expect(_log_slope)",
        "return self._normal().entropy() + self._expect(_log_slope)",
        "tests/distributions/test_logit_normal.py::test_entropy_is_minus_the_mean_log_density",
    ),
    Mutant(
        "the KL's arguments are swapped",
        "distributions/logit_normal.py",
        "return kl_divergence(p._normal(), q._normal())",
        "return kl_divergence(q._normal(), p._normal())",
        "tests/distributions/test_logit_normal.py::test_kl_is_that_of_the_latents_and_of_the_values",
    ),
    Mutant(
        "one Newton step in the graph, not two",
        "distributions/logit_normal.py",
        "for _ in range(2):",
        "for _ in range(1):",
        "tests/distributions/test_logit_normal.py::test_mode_derivatives",
    ),
    Mutant(
        "the lower mode is taken for the higher",
        "distributions/logit_normal.py",
        "return torch.where(self.loc < 0, -root, root)",
        "return torch.where(self.loc > 0, -root, root)",
        "tests/distributions/test_logit_normal.py::test_mode_is_stationary",
    ),
    Mutant(
        "two modes too early",
        "distributions/logit_normal.py",
        "reach = variance * k - 2 * torch.log1p(k) - torch.log(variance / 2)",
        "reach = variance * k - torch.log1p(k) - torch.log(variance / 2)",
        "tests/distributions/test_logit_normal.py::test_two_modes_become_one_at_the_stated_location",
    ),
    Mutant(
        "the variance cancels at small scales",
        "distributions/logit_normal.py",
        "return step.sign() * torch.sigmoid(upper) * torch.sigmoid(-lower) * -torch.expm1(-step.abs())",
        "return torch.sigmoid(z + step) - torch.sigmoid(z)",
        "tests/distributions/test_logit_normal.py::test_moments_against_mpmath",
    ),
    Mutant(
        "the bounds are swapped",
        "distributions/bounds.py",
        "fraction < 0.5, self.low + self.width * fraction, self.high - self.width * complement",
        "fraction < 0.5, self.high - self.width * fraction, self.low + self.width * complement",
        "tests/distributions/test_contract.py::test_latent_and_value_invert_each_other",
    ),
    Mutant(
        "a sample may sit on a bound",
        "distributions/bounds.py",
        "return torch.clamp(value, smallest, largest)",
        "return value",
        "tests/distributions/test_contract.py::test_no_latent_maps_onto_a_bound",
    ),
    Mutant(
        "the KL ignores unequal upper bounds",
        "distributions/bounds.py",
        "if bool(((p.low != q.low) | (p.high != q.high)).any()):",
        "if bool((p.low != q.low).any()):",
        "tests/distributions/test_contract.py::test_kl_needs_equal_bounds",
    ),
    Mutant(
        "the Beta's KL in single precision",
        "distributions/scaled_beta.py",
        "return self.concentration1.double(), self.concentration0.double()",
        "return self.concentration1, self.concentration0",
        "tests/distributions/test_scaled_beta.py::test_the_float32_kl_can_be_trusted",
    ),
    Mutant(
        "small concentrations are not boosted",
        "distributions/scaled_beta.py",
        "return boosted.log() + torch.log1p(-uniform) / concentration",
        "return boosted.log()",
        "tests/distributions/test_scaled_beta.py::test_latents_have_the_laws_moments",
    ),
    Mutant(
        "the Normal's lower tail is lost",
        "distributions/standard_normal.py",
        "return torch.erfc(-x / math.sqrt(2)) / 2",
        "return torch.special.ndtr(x)",
        "tests/distributions/test_clipped_normal.py::test_the_tails_of_the_masses",
    ),
    Mutant(
        "the atoms are scored as density",
        "distributions/clipped_normal.py",
        "return torch.where(value == self.low, on_low, torch.where(value == self.high, on_high, between))",
        "return between",
        "tests/distributions/test_clipped_normal.py::test_capg_is_unbiased_with_lower_variance",
    ),
    Mutant(
        "the clipped KL loses an atom",
        "distributions/clipped_normal.py",
        "divergence = on_low + on_high - p_parts.m0",
        "divergence = on_low - p_parts.m0",
        "tests/distributions/test_clipped_normal.py::test_kl_against_quadrature_and_below_the_gaussians",
    ),
    Mutant(
        "the mixed entropy's atoms are subtracted",
        "distributions/clipped_normal.py",
        "return (on_bounds + between)",
        "return (between - on_bounds)",
        "tests/distributions/test_clipped_normal.py::test_entropy_is_minus_the_mean_log_prob",
    ),
    Mutant(
        "the quadrature ignores the scale",
        "distributions/quadrature.py",
        "rate = scale / (2 * math.pi)",
        "rate = torch.full_like(scale, 1e-3)",
        "tests/distributions/test_quadrature.py::test_graded_trapezoid_is_right_at_every_scale",
    ),
    Mutant(
        "saturation counts one bound",
        "book/figures.py",
        "mass = float(np.mean(action == bound))",
        "mass = float(np.mean(action >= bound))",
        "tests/book/test_figures.py::test_saturation_is_what_the_outer_bars_say",
    ),
    Mutant(
        "the alt text is lost on the way to the page",
        "book/alt_text.py",
        '            node["alt"] = alt',
        '            node["title"] = alt',
        "tests/book/test_figures.py::test_alt_text_reaches_the_page",
    ),
    Mutant(
        "the explorable's Gaussian is twice as wide",
        "book/explorables.py",
        "return m, 0.5 * self.sigma * (1.0 - m * m)",
        "return m, self.sigma * (1.0 - m * m)",
        "tests/book/test_explorables.py::test_gaussian_is_the_tangent_of_the_squash",
    ),
    Mutant(
        "the explorable counts modes on one side",
        "book/_explorables/numerics.js",
        "if (g(-turn) > 0) modes",
        "if (g(turn) > 0) modes",
        "tests/book/test_explorables.py::test_logit_normal_agrees_with_the_package",
    ),
    Mutant(
        "a known mistake is graded as right",
        "book/graders.py",
        "        if agrees(answer, case.expected, case.rtol):\n            continue",
        "        if agrees(answer, case.expected, 1e9):\n            continue",
        "tests/book/test_graders.py::test_known_mistakes_are_named",
    ),
    Mutant(
        "truncation comes a step late",
        "robots/vector_env.py",
        "truncated = self._elapsed >= self.max_episode_steps",
        "truncated = self._elapsed > self.max_episode_steps",
        "tests/robots/test_vector_env.py::test_truncation_at_the_limit",
    ),
    Mutant(
        "the final observation is overwritten",
        "robots/vector_env.py",
        "            final_obs[robot] = self._obs[robot].copy()",
        "            final_obs[robot] = self._obs[robot]",
        "tests/robots/test_vector_env.py::test_the_final_observation_is_that_of_the_old_episode",
    ),
    Mutant(
        "robots share a generator",
        "robots/vector_env.py",
        "self.task.draw_start(self._generators[robot])",
        "self.task.draw_start(self._generators[0])",
        "tests/robots/test_vector_env.py::test_a_robot_does_not_depend_on_the_others_nor_on_threads[Hopper-v5]",
    ),
    Mutant(
        "a saved state forgets the clock",
        "robots/vector_env.py",
        '        self._elapsed[:] = state["elapsed"]\n',
        "",
        "tests/robots/test_vector_env.py::test_a_saved_state_goes_on_bit_for_bit[HalfCheetah-v5]",
    ),
    Mutant(
        "the next step overwrites what was returned",
        "robots/vector_env.py",
        "        return self._obs.copy(), reward, terminated, truncated, infos",
        "        return self._obs, reward, terminated, truncated, infos",
        "tests/robots/test_vector_env.py::test_what_is_returned_is_the_callers_own",
    ),
    Mutant(
        "actions are never clipped",
        "robots/vector_env.py",
        '        if self.action_mode == "clip":\n',
        '        if self.action_mode == "never":\n',
        "tests/robots/test_vector_env.py::test_raw_actions_cost_more_and_move_the_same",
    ),
    Mutant(
        "a robot is unhealthy at its limit",
        "robots/contact_tasks.py",
        "(height >= 0.2)",
        "(height > 0.2)",
        "tests/robots/test_parity.py::test_health_at_its_limits[Ant-v5]",
    ),
    Mutant(
        "the control cost is a reward",
        "robots/tasks.py",
        "        return gain - cost, terms",
        "        return gain + cost, terms",
        "tests/robots/test_vector_env.py::test_the_reward_is_the_sum_of_its_terms[HalfCheetah-v5]",
    ),
    Mutant(
        "every MuJoCo message is swallowed",
        "robots/messages.py",
        "    if _KNOWN in message:\n",
        "    if message:\n",
        "tests/robots/test_messages.py::test_every_other_message_is_a_warning",
    ),
    Mutant(
        "drawing without OpenGL is not refused",
        "robots/rendering.py",
        "        headless.require_backend()\n",
        "",
        "tests/robots/test_headless.py::test_mujoco_imported_too_early_is_an_error_not_a_crash",
    ),
    Mutant(
        "drawing changes the simulation's model",
        "robots/rendering.py",
        "    model = copy.copy(model)\n",
        "",
        "tests/robots/test_rendering.py::test_drawing_changes_nothing_in_the_environment",
    ),
    Mutant(
        "videos play by themselves",
        "book/videos.py",
        "<video controls muted",
        "<video controls autoplay muted",
        "tests/book/test_videos.py::test_the_page_shows_it_quietly",
    ),
)
