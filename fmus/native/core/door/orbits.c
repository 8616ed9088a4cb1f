#include "door/orbits.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

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

/* Displacement at the contact of impact i for a unit speed of impact k, with its first and second time derivatives. */
static void answer(const vi_orbit_response *response, int i, int k, double g[3])
{
    const vi_orbit_body *body = response->body;
    const int32_t *contact = response->train->contact;
    const double *shape = body->shape + (ptrdiff_t)contact[i] * body->modes;
    double x[VI_MODES], v[VI_MODES], drag[VI_MODES];
    vi_orbit_train_answer(response, contact[k], vi_orbit_since(response, i, k), x, v);
    vi_orbit_drag(response, v, drag);
    const double factor = (1.0 + body->restitution[contact[k]]) * body->direction[contact[i]]
                          * body->direction[contact[k]];
    g[0] = g[1] = g[2] = 0.0;
    for (int j = 0; j < body->modes; ++j) {
        const double weight = factor * shape[j];
        g[0] += weight * x[j];
        g[1] += weight * v[j];
        g[2] += weight * (-response->mode[j].stiffness * x[j] - drag[j]);
    }
}

VI_DOOR int vi_door_orbit(const vi_orbit_body *body, const vi_orbit_train *train, double velocity[], double distance[],
                          double distance_slope[], double velocity_slope[])
{
    vi_orbit_response response;
    const int refused = vi_orbit_respond(&response, body, train);
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    const int n = train->impacts;
    double equations[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS], kept[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS];
    double g[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS][3];
    double right[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS + 1];
    double steady[VI_ORBIT_IMPACTS][3];
    for (int i = 0; i < n; ++i) {
        vi_orbit_steady_at(&response, i, steady[i]);
        for (int k = 0; k < n; ++k) {
            answer(&response, i, k, g[i][k]);
            equations[i][k] = kept[i][k] = (i == k ? 1.0 : 0.0) - g[i][k][1];
        }
        right[i][0] = steady[i][1];
    }
    if (!solve(n, equations, 1, right)) {
        return VI_ORBIT_SINGULAR;
    }
    for (int i = 0; i < n; ++i) {
        velocity[i] = right[i][0];
    }
    /* right-hand sides of the velocities' derivatives over the time of each impact */
    for (int i = 0; i < n; ++i) {
        double own = steady[i][2];
        distance[i] = steady[i][0];
        for (int k = 0; k < n; ++k) {
            distance[i] += g[i][k][0] * velocity[k];
            own += k == i ? 0.0 : g[i][k][2] * velocity[k];
            right[i][k] = k == i ? 0.0 : -g[i][k][2] * velocity[k];
        }
        right[i][i] = own;
    }
    if (!solve(n, kept, n, right)) {
        return VI_ORBIT_SINGULAR;
    }
    const double second = 1.0 / body->angular_frequency; /* per radian */
    for (int i = 0; i < n; ++i) {
        for (int m = 0; m < n; ++m) {
            double slope = m == i ? velocity[i] - g[i][i][1] * velocity[i] : -g[i][m][1] * velocity[m];
            for (int k = 0; k < n; ++k) {
                slope += g[i][k][0] * right[k][m];
            }
            distance_slope[i * n + m] = slope * second;
            velocity_slope[i * n + m] = right[i][m] * second;
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
    for (int j = 0; j < body->modes; ++j) {
        vi_orbit_steady(response, j, train->phase[i], &state[j], &state[body->modes + j]);
    }
    for (int k = 0; k < train->impacts; ++k) {
        const int32_t contact = train->contact[k];
        const double taken = (1.0 + body->restitution[contact]) * velocity[k] * body->direction[contact];
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
    const int modes = body->modes, states = 2 * modes, n = train->impacts;
    for (int i = 0; i < n; ++i) {
        after_impact(&response, velocity, i, state + (ptrdiff_t)i * states);
    }
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
