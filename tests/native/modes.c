/* Modes of random chains, divided and graded at random, and of beams to high order: invariants that need no
 * reference. */
#include <math.h>

#include "check.h"
#include "modes/beam_modes.h"
#include "modes/beam_residual.h"
#include "modes/chain_modes.h"

static double decades(uint64_t *seed, double low, double high)
{
    return pow(10.0, uniform(seed, low, high));
}

static vi_chain random_chain(uint64_t *seed)
{
    vi_chain chain = {.masses = 1 + (int)choice(seed, VI_MODES)};
    const double cuts = choice(seed, 2) ? 0.0 : uniform(seed, 0.0, 0.5);
    const double spread = uniform(seed, 0.0, 1.0);
    for (int e = 0; e <= chain.masses; ++e) {
        if (e < chain.masses) {
            chain.mass[e] = decades(seed, -9.0 * spread, 9.0 * spread);
        }
        chain.stiffness[e] = uniform(seed, 0.0, 1.0) < cuts ? 0.0 : decades(seed, -5.0 * spread, 15.0 * spread);
        chain.damping[e] = choice(seed, 3) ? chain.stiffness[e] * 1e-3 : uniform(seed, 0.0, 1.0);
    }
    if (choice(seed, 2)) {
        chain.stiffness[chain.masses] = chain.damping[chain.masses] = 0.0;
    }
    return chain;
}

/* Number of groups of masses that no spring ties to the ground. */
static int floating_groups(const vi_chain *chain)
{
    int groups = 0;
    bool tied = chain->stiffness[0] > 0.0;
    for (int e = 1; e <= chain->masses; ++e) {
        if (e == chain->masses || chain->stiffness[e] == 0.0) {
            tied = tied || (e == chain->masses && chain->stiffness[e] > 0.0);
            groups += !tied;
            tied = false;
        }
    }
    return groups;
}

static void check_orthonormal(const vi_chain *chain, const vi_chain_modes *modes)
{
    for (int i = 0; i < chain->masses; ++i) {
        for (int j = 0; j <= i; ++j) {
            double product = 0.0;
            for (int mass = 0; mass < chain->masses; ++mass) {
                product += chain->mass[mass] * modes->shape[mass][i] * modes->shape[mass][j];
            }
            CHECK(fabs(product - (i == j)) <= 1e-13, "%d masses: modes %d, %d: %.17g", chain->masses, i, j, product);
        }
    }
}

/* Chains with every spring but the far one: det(M^-1 K) = product of k_i / m_i, which the smallest frequencies affect
 * as much as the largest. */
static void check_determinant(const vi_chain *chain, const vi_chain_modes *modes)
{
    double sum = 0.0;
    for (int i = 0; i < chain->masses; ++i) {
        if (chain->stiffness[i] == 0.0 || chain->stiffness[chain->masses] > 0.0) {
            return;
        }
        sum += 2.0 * log(modes->natural[i]) - log(chain->stiffness[i]) + log(chain->mass[i]);
    }
    CHECK(fabs(sum) <= 2e-12, "%d masses: logarithm of the ratio of determinants %g", chain->masses, sum);
}

static void check_trace(const vi_chain *chain, const vi_chain_modes *modes)
{
    double trace = 0.0, sum = 0.0;
    for (int i = 0; i < chain->masses; ++i) {
        trace += (chain->stiffness[i] + chain->stiffness[i + 1]) / chain->mass[i];
        sum += modes->natural[i] * modes->natural[i];
    }
    CHECK(fabs(sum - trace) <= 1e-12 * trace, "%d masses: trace %.17g for %.17g", chain->masses, sum, trace);
}

static void chains_have_orthonormal_modes_and_their_invariants(uint64_t *seed)
{
    static vi_chain_modes modes;
    for (int n = 0; n < 300; ++n) {
        const vi_chain chain = random_chain(seed);
        CHECK(vi_chain_find_modes(&chain, &modes), "chain %d", n);
        int rigid = 0;
        for (int j = 0; j < chain.masses; ++j) {
            rigid += modes.natural[j] == 0.0;
            CHECK(j == 0 || modes.natural[j] >= modes.natural[j - 1], "chain %d: mode %d", n, j);
            CHECK(modes.damping_ratio[j] >= 0.0 && isfinite(modes.damping_ratio[j]), "chain %d: mode %d", n, j);
        }
        CHECK(rigid == floating_groups(&chain), "chain %d: %d", n, rigid);
        check_orthonormal(&chain, &modes);
        check_determinant(&chain, &modes);
        check_trace(&chain, &modes);
    }
}

static void impossible_chains_are_refused(void)
{
    static vi_chain_modes modes;
    const double wrong[] = {0.0, -1.0, NAN, INFINITY};
    for (int n = 0; n < 4; ++n) {
        vi_chain chain = {.masses = 2, .mass = {1.0, wrong[n]}, .stiffness = {1.0, 1.0, 0.0}};
        CHECK(!vi_chain_find_modes(&chain, &modes), "mass %g", wrong[n]);
        chain.mass[1] = 1.0;
        chain.stiffness[2] = wrong[n];
        CHECK(vi_chain_find_modes(&chain, &modes) == (n == 0), "stiffness %g", wrong[n]);
        chain.stiffness[2] = 0.0;
        chain.damping[0] = wrong[n];
        CHECK(vi_chain_find_modes(&chain, &modes) == (n == 0), "damping %g", wrong[n]);
    }
    for (int masses = 0; masses <= VI_MODES + 1; masses += VI_MODES + 1) {
        const vi_chain chain = {.masses = masses, .mass = {1.0}, .stiffness = {1.0}};
        CHECK(!vi_chain_find_modes(&chain, &modes), "%d masses", masses);
    }
    const vi_chain wide = {.masses = 2, .mass = {1e-300, 1.0}, .stiffness = {1e300, 1.0, 0.0}};
    CHECK(!vi_chain_find_modes(&wide, &modes), "%s", "600 decades");
}

static void beams_stay_bounded_to_high_order(uint64_t *seed)
{
    for (int n = 0; n < 20000; ++n) {
        const vi_beam_boundary boundary = (vi_beam_boundary)(1 + choice(seed, 4));
        const int j = 1 + (int)choice(seed, choice(seed, 2) ? 64 : 5000);
        const double s = choice(seed, 8) ? uniform(seed, 0.0, 1.0) : (double)choice(seed, 2);
        const double xi = vi_beam_eigenvalue(boundary, j);
        CHECK(fabs(xi - 3.14159265358979 * j) <= 1.6, "xi_%d = %.17g", j, xi);
        for (int derivative = 0; derivative <= 3; ++derivative) {
            const double scaled = vi_beam_shape(boundary, j, s, derivative) / pow(xi, derivative);
            /* at most 2 sig, and sig <= 1.0185 */
            CHECK(fabs(scaled) <= 2.04, "boundary %d, mode %d at %g: %g", (int)boundary, j, s, scaled);
        }
    }
}

static void collocated_impulses_move_one_point(uint64_t *seed)
{
    double grid[VI_MODES], direction[VI_MODES];
    for (int n = 0; n < 300; ++n) {
        const vi_beam_boundary boundary = (vi_beam_boundary)(1 + choice(seed, 4));
        const int points = 1 + (int)choice(seed, VI_MODES), at = (int)choice(seed, (unsigned)points);
        for (int k = 0; k < points; ++k) { /* one point in each of equal cells, clear of both ends */
            grid[k] = (k + uniform(seed, 0.4, 0.6)) / points;
        }
        CHECK(vi_beam_collocation(boundary, points, grid, at, direction), "grid of %d points", points);
        for (int k = 0; k < points; ++k) {
            double velocity = 0.0, size = 0.0;
            for (int j = 0; j < points; ++j) {
                velocity += vi_beam_shape(boundary, j + 1, grid[k], 0) * direction[j];
                size += fabs(direction[j]);
            }
            CHECK(fabs(velocity - (k == at)) <= 1e-13 * (1.0 + size), "point %d of %d: %g", k, points, velocity);
        }
        grid[0] = choice(seed, 2) || points == 1 ? 0.0 : grid[points - 1];
        CHECK(!vi_beam_collocation(boundary, points, grid, at, direction), "singular grid of %d points", points);
    }
    CHECK(!vi_beam_collocation(VI_CLAMPED_FREE, 0, grid, 0, direction), "%s", "no points");
    CHECK(!vi_beam_collocation(VI_CLAMPED_FREE, VI_MODES + 1, grid, 0, direction), "%s", "too many points");
}

/* With its residual vectors a beam yields to static forces at the points as with all its modes. */
static void residual_vectors_make_the_flexibility_whole(uint64_t *seed)
{
    for (int trial = 0; trial < 300; ++trial) {
        const vi_beam_boundary boundary = (vi_beam_boundary)(1 + choice(seed, 4));
        const int natural = 1 + (int)choice(seed, VI_MODES - 1), points = 1 + (int)choice(seed, VI_PORTS);
        double point[VI_PORTS];
        for (int k = 0; k < points; ++k) { /* one point in each of equal cells */
            point[k] = (k + uniform(seed, 0.3, 0.7)) / points;
        }
        if (choice(seed, 2) && boundary == VI_CLAMPED_FREE) {
            point[points - 1] = 1.0;
        }
        vi_beam_residual residual;
        if (vi_beam_residual_find(&residual, boundary, natural, points, point) != 0) {
            CHECK(points > 1, "one point at %g of mode %d was refused", point[0], natural);
            continue;
        }
        double last = vi_beam_eigenvalue(boundary, natural);
        for (int i = 0; i < points; ++i) {
            CHECK(residual.eigenvalue[i] > last, "vector %d of %d: %g after %g", i, points, residual.eigenvalue[i], last);
            last = residual.eigenvalue[i];
            CHECK(isfinite(vi_beam_residual_participation(&residual, i)), "vector %d", i);
        }
        for (int k = 0; k < points; ++k) {
            double sum = 0.0;
            for (int j = 1; j <= natural; ++j) {
                const double part = vi_beam_shape(boundary, j, point[k], 0) / pow(vi_beam_eigenvalue(boundary, j), 2.0);
                sum += part * part;
            }
            for (int i = 0; i < points; ++i) {
                const double part = vi_beam_residual_shape(&residual, i, point[k]) / pow(residual.eigenvalue[i], 2.0);
                sum += part * part;
            }
            const double whole = vi_beam_static_shape(boundary, point[k], point[k]);
            CHECK(fabs(sum - whole) <= 1e-12 * whole, "%d modes, point %g: %.17g, not %.17g", natural, point[k], sum, whole);
        }
    }
    const double twice[2] = {0.5, 0.5}, support[1] = {0.0};
    vi_beam_residual residual;
    CHECK(vi_beam_residual_find(&residual, VI_PINNED_PINNED, 3, 2, twice) == 2, "%s", "one point twice");
    CHECK(vi_beam_residual_find(&residual, VI_PINNED_PINNED, 3, 1, support) == 1, "%s", "a point on a support");
}

int main(void)
{
    uint64_t seed = 20250;
    chains_have_orthonormal_modes_and_their_invariants(&seed);
    impossible_chains_are_refused();
    beams_stay_bounded_to_high_order(&seed);
    collocated_impulses_move_one_point(&seed);
    residual_vectors_make_the_flexibility_whole(&seed);
    return 0;
}
