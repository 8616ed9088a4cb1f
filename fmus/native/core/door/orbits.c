#include "door/orbits.h"

#include <float.h>
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "door/orbit_placing.h"

/* Most Newton steps for the velocities where restitution falls with speed, and most halvings of a step. */
enum { MOST_STEPS = 60, MOST_HALVINGS = 30 };
/* Error of the velocities' equations, over the size of their terms, at which they are solved; and largest error where
 * rounding ends the search. */
static const double SOLVED = 4.0 * DBL_EPSILON, ROUNDING = 1e3 * DBL_EPSILON;

/* Share of its speed that a slow impact of P(1,q) loses, below which it is rounding: restitution 1 without damping. */
static const double ELASTIC = 1e-12;

/* ---- linear equations of the velocities ---- */

/* Solve a x = b for several right-hand sides, b[row][sides], by elimination with pivots; false where a is singular. */
static bool solve(int n, double a[][VI_ORBIT_IMPACTS], int sides, double b[][VI_ORBIT_IMPACTS + 1])
{
    for (int k = 0; k < n; ++k) {
        int pivot = k;
        for (int i = k + 1; i < n; ++i) {
            pivot = fabs(a[i][k]) > fabs(a[pivot][k]) ? i : pivot;
        }
        if (!(fabs(a[pivot][k]) > 0.0)) {
            return false;
        }
        for (int j = 0; pivot != k && j < n; ++j) {
            const double kept = a[k][j];
            a[k][j] = a[pivot][j];
            a[pivot][j] = kept;
        }
        for (int j = 0; pivot != k && j < sides; ++j) {
            const double kept = b[k][j];
            b[k][j] = b[pivot][j];
            b[pivot][j] = kept;
        }
        for (int i = k + 1; i < n; ++i) {
            const double share = a[i][k] / a[k][k];
            for (int j = k; j < n; ++j) {
                a[i][j] -= share * a[k][j];
            }
            for (int j = 0; j < sides; ++j) {
                b[i][j] -= share * b[k][j];
            }
        }
    }
    for (int k = n - 1; k >= 0; --k) {
        for (int j = 0; j < sides; ++j) {
            for (int i = k + 1; i < n; ++i) {
                b[k][j] -= a[k][i] * b[i][j];
            }
            b[k][j] /= a[k][k];
        }
    }
    return true;
}

/* ---- velocities where restitution falls with speed: equations.md 4.7 ---- */

/* The p equations of the velocities, and what the impacts take: speeds of equal impulse, with their derivatives. */
typedef struct {
    double g[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS][3], steady[VI_ORBIT_IMPACTS][3];
    double equal[VI_ORBIT_IMPACTS], share[VI_ORBIT_IMPACTS];
} speeds;

/* Find what the impacts take and the errors of the equations; return the root of the errors' squares. `size`: of the
 * largest terms. */
static double find_errors(const vi_orbit_response *response, const double velocity[], speeds *s, double error[],
                          double *size)
{
    const int n = response->train->impacts;
    double squares = 0.0; /* never a maximum, which would lose a NaN */
    for (int k = 0; k < n; ++k) {
        s->equal[k] = vi_orbit_equal_speed(response->body, response->train->contact[k], velocity[k], &s->share[k]);
    }
    *size = 0.0;
    for (int i = 0; i < n; ++i) {
        double terms = fabs(velocity[i]) + fabs(s->steady[i][1]);
        error[i] = velocity[i] - s->steady[i][1];
        for (int k = 0; k < n; ++k) {
            const double answered = s->g[i][k][1] * s->equal[k];
            error[i] -= answered;
            terms += fabs(answered);
        }
        squares += error[i] * error[i];
        *size = fmax(*size, terms);
    }
    return sqrt(squares);
}

/* Set the matrix of the velocities' equations, linear about the present velocities. */
static void set_matrix(int n, const speeds *s, double matrix[][VI_ORBIT_IMPACTS])
{
    for (int i = 0; i < n; ++i) {
        for (int k = 0; k < n; ++k) {
            matrix[i][k] = (i == k ? 1.0 : 0.0) - s->g[i][k][1] * s->share[k];
        }
    }
}

/* Find the velocities by Newton's method from those of a restitution of 0. Returns one of VI_ORBIT_*. */
static int find_falling(const vi_orbit_response *response, speeds *s, double velocity[])
{
    const int n = response->train->impacts;
    double matrix[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS], right[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS + 1];
    double error[VI_ORBIT_IMPACTS], tried[VI_ORBIT_IMPACTS], size;
    double largest = find_errors(response, velocity, s, error, &size);
    for (int step = 0; step < MOST_STEPS && !(largest <= SOLVED * size); ++step) {
        set_matrix(n, s, matrix);
        for (int i = 0; i < n; ++i) {
            right[i][0] = error[i];
        }
        if (!solve(n, matrix, 1, right)) {
            return VI_ORBIT_SINGULAR;
        }
        double part = 1.0, left = largest;
        for (int halving = 0; !(left < largest) || halving == 0; ++halving, part *= 0.5) {
            if (halving > MOST_HALVINGS) {
                (void)find_errors(response, velocity, s, error, &size);
                return largest <= ROUNDING * size ? VI_ORBIT_DONE : VI_ORBIT_UNSOLVED;
            }
            for (int i = 0; i < n; ++i) {
                tried[i] = velocity[i] - part * right[i][0];
            }
            left = find_errors(response, tried, s, error, &size);
        }
        largest = left;
        memcpy(velocity, tried, (size_t)n * sizeof velocity[0]);
    }
    return largest <= ROUNDING * size ? VI_ORBIT_DONE : VI_ORBIT_UNSOLVED;
}

/* Find the equations of the velocities, and the velocities; `matrix` and `right` are overwritten. */
static int find_velocities(const vi_orbit_response *response, speeds *s, double velocity[],
                           double matrix[][VI_ORBIT_IMPACTS], double right[][VI_ORBIT_IMPACTS + 1])
{
    const int n = response->train->impacts;
    bool any = false;
    for (int i = 0; i < n; ++i) {
        const int32_t contact = response->train->contact[i];
        vi_orbit_steady_at(response, i, s->steady[i]);
        for (int k = 0; k < n; ++k) {
            vi_orbit_answer(response, i, k, s->g[i][k]);
        }
        right[i][0] = s->steady[i][1];
        /* an impact without restitution: with a restitution of 1 an undamped body might have no velocities */
        const bool falls = response->body->yield_velocity[contact] > 0.0;
        s->share[i] = falls ? 1.0 / (1.0 + response->body->restitution[contact]) : 1.0;
        any = any || falls;
    }
    set_matrix(n, s, matrix);
    if (!solve(n, matrix, 1, right)) {
        return VI_ORBIT_SINGULAR;
    }
    for (int i = 0; i < n; ++i) {
        velocity[i] = s->equal[i] = right[i][0];
    }
    return any ? find_falling(response, s, velocity) : VI_ORBIT_DONE;
}

VI_DOOR int vi_door_orbit(const vi_orbit_body *body, const vi_orbit_train *train, double velocity[], double distance[],
                          double distance_slope[], double velocity_slope[])
{
    vi_orbit_response response;
    const int refused = vi_orbit_respond(&response, body, train);
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    vi_orbit_placing placed;
    if (!vi_orbit_find_placing(&response, &placed)) {
        return VI_ORBIT_ADRIFT;
    }
    const int n = train->impacts;
    double matrix[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS], right[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS + 1];
    speeds s;
    const int unsolved = find_velocities(&response, &s, velocity, matrix, right);
    if (unsolved != VI_ORBIT_DONE) {
        return unsolved;
    }
    /* right-hand sides of the velocities' derivatives over the time of each impact */
    for (int i = 0; i < n; ++i) {
        double own = s.steady[i][2];
        distance[i] = s.steady[i][0];
        for (int k = 0; k < n; ++k) {
            distance[i] += s.g[i][k][0] * s.equal[k];
            own += k == i ? 0.0 : s.g[i][k][2] * s.equal[k];
            right[i][k] = k == i ? 0.0 : -s.g[i][k][2] * s.equal[k];
        }
        right[i][i] = own;
    }
    set_matrix(n, &s, matrix);
    if (!solve(n, matrix, n, right)) {
        return VI_ORBIT_SINGULAR;
    }
    const double second = 1.0 / body->angular_frequency; /* per radian */
    for (int i = 0; i < n; ++i) {
        for (int m = 0; m < n; ++m) {
            velocity_slope[i * n + m] = right[i][m] * second;
            right[i][m] *= s.share[i]; /* of the speed of equal impulse */
        }
    }
    for (int i = 0; i < n; ++i) {
        for (int m = 0; m < n; ++m) {
            double slope = m == i ? velocity[i] - s.g[i][i][1] * s.equal[i] : -s.g[i][m][1] * s.equal[m];
            for (int k = 0; k < n; ++k) {
                slope += s.g[i][k][0] * right[k][m];
            }
            distance_slope[i * n + m] = slope * second;
        }
    }
    double place[VI_MODES], faster[VI_ORBIT_IMPACTS];
    vi_orbit_put_in_place(&response, &placed, distance, 1, place);
    vi_orbit_drift(&response, s.equal, 1.0, distance, 1);
    for (int m = 0; m < n; ++m) {
        for (int i = 0; i < n; ++i) {
            faster[i] = s.share[i] * velocity_slope[i * n + m];
        }
        vi_orbit_put_in_place(&response, &placed, distance_slope + m, n, place);
        vi_orbit_drift(&response, faster, 0.0, distance_slope + m, n);
    }
    return VI_ORBIT_DONE;
}

VI_DOOR int vi_door_orbit_wave(const vi_orbit_body *body, const vi_orbit_train *train, vi_orbit_wave *wave)
{
    vi_orbit_response response;
    const int refused = train->impacts == 1 ? vi_orbit_respond(&response, body, train) : VI_ORBIT_REFUSED;
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    vi_orbit_placing placed;
    if (!vi_orbit_find_placing(&response, &placed)) {
        return VI_ORBIT_ADRIFT;
    }
    double g[3], place[VI_MODES];
    vi_orbit_answer(&response, 0, 0, g);
    const int32_t contact = train->contact[0];
    if (!(fabs(1.0 - g[1]) > (body->yield_velocity[contact] > 0.0 ? ELASTIC : 0.0))) {
        return VI_ORBIT_SINGULAR;
    }
    const double direction = body->direction[contact], none = 0.0, one = 1.0;
    vi_orbit_gap gap;
    vi_orbit_steady_gap(&response, contact, &gap);
    wave->level = direction * (gap.level - body->position[contact]);
    vi_orbit_put_in_place(&response, &placed, &wave->level, 1, place);
    vi_orbit_drift(&response, &none, 1.0, &wave->level, 1);
    wave->answer[0] = g[0];
    wave->answer[1] = g[1];
    vi_orbit_put_in_place(&response, &placed, wave->answer, 1, place);
    vi_orbit_drift(&response, &one, 0.0, wave->answer, 1);
    for (int k = 0; k < body->harmonics; ++k) {
        const double w = body->order[k] * body->angular_frequency;
        const double x[2] = {direction * gap.cosine[k], direction * gap.sine[k]};
        const double speed[2] = {w * x[1] / (1.0 - g[1]), -w * x[0] / (1.0 - g[1])};
        double *const part[2] = {&wave->cosine[k], &wave->sine[k]};
        wave->steady_cosine[k] = x[0];
        wave->steady_sine[k] = x[1];
        for (int side = 0; side < 2; ++side) {
            *part[side] = x[side] + g[0] * speed[side];
            vi_orbit_put_in_place(&response, &placed, part[side], 1, place);
            vi_orbit_drift(&response, &speed[side], 0.0, part[side], 1);
        }
    }
    return VI_ORBIT_DONE;
}

/* ---- the motion ---- */

/* Modal displacements and velocities just after impact i. */
static void after_impact(const vi_orbit_response *response, const double velocity[], int i, double state[])
{
    const vi_orbit_body *body = response->body;
    const vi_orbit_train *train = response->train;
    vi_orbit_steady(response, train->phase[i], state, state + body->modes);
    for (int k = 0; k < train->impacts; ++k) {
        const int32_t contact = train->contact[k];
        double slope;
        const double equal = vi_orbit_equal_speed(body, contact, velocity[k], &slope);
        const double taken = (1.0 + body->restitution[contact]) * equal * body->direction[contact];
        double x[VI_MODES], v[VI_MODES];
        vi_orbit_train_answer(response, contact, k == i ? 0.0 : vi_orbit_since(response, i, k), x, v);
        for (int j = 0; j < body->modes; ++j) {
            state[j] += taken * x[j];
            state[body->modes + j] += taken * v[j];
        }
    }
}

VI_DOOR int vi_door_orbit_motion(const vi_orbit_body *body, const vi_orbit_train *train, const double velocity[],
                                 double state[], double monodromy[])
{
    double change[VI_ORBIT_STATES][VI_ORBIT_STATES];
    vi_orbit_response response;
    const int refused = vi_orbit_respond(&response, body, train);
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    vi_orbit_placing placed;
    if (!vi_orbit_find_placing(&response, &placed)) {
        return VI_ORBIT_ADRIFT;
    }
    const int modes = body->modes, states = 2 * modes, n = train->impacts;
    for (int i = 0; i < n; ++i) {
        after_impact(&response, velocity, i, state + (ptrdiff_t)i * states);
    }
    vi_orbit_place_states(&response, &placed, state);
    for (int row = 0; row < states; ++row) {
        for (int c = 0; c < states; ++c) {
            change[row][c] = row == c ? 1.0 : 0.0;
        }
    }
    for (int passed = 1; passed <= n; ++passed) {
        const int i = passed % n;
        const double u = vi_orbit_since(&response, i, passed - 1);
        vi_orbit_carry(&response, u, states, change);
        vi_orbit_salt(&response, train->contact[i], train->phase[i], velocity[i], state + (ptrdiff_t)i * states, states,
                      change);
    }
    for (int row = 0; row < states; ++row) {
        memcpy(monodromy + (ptrdiff_t)row * states, change[row], (size_t)states * sizeof change[row][0]);
    }
    return VI_ORBIT_DONE;
}
