#include "door/orbits.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

/* Share of a mode's displacement that no other mode gives to the contacts, below which its position is not known. */
static const double ADRIFT = 1e-9;

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
        g[2] += weight * (vi_orbit_evening(response, contact[k], j) - response->mode[j].stiffness * x[j] - drag[j]);
    }
}

/* ---- modes without a spring ---- */

/* Displacements that the modes without a spring give to the contacts of the impacts: q r, with orthonormal columns q. */
typedef struct {
    double q[VI_MODES][VI_ORBIT_IMPACTS], r[VI_MODES][VI_MODES];
} placing;

/* Find the displacements; false where no impact tells the position of a mode, or two modes move all contacts alike. */
static bool find_placing(const vi_orbit_response *response, placing *found)
{
    const vi_orbit_body *body = response->body;
    const int n = response->train->impacts;
    for (int l = 0; l < response->loose; ++l) {
        double *column = found->q[l], size = 0.0, left = 0.0;
        for (int i = 0; i < n; ++i) {
            const int32_t contact = response->train->contact[i];
            column[i] = body->direction[contact] * body->shape[(ptrdiff_t)contact * body->modes + l];
            size += column[i] * column[i];
        }
        for (int before = 0; before < l; ++before) {
            double along = 0.0;
            for (int i = 0; i < n; ++i) {
                along += found->q[before][i] * column[i];
            }
            for (int i = 0; i < n; ++i) {
                column[i] -= along * found->q[before][i];
            }
            found->r[before][l] = along;
        }
        for (int i = 0; i < n; ++i) {
            left += column[i] * column[i];
        }
        if (!(left > ADRIFT * ADRIFT * size)) {
            return false;
        }
        found->r[l][l] = sqrt(left);
        for (int i = 0; i < n; ++i) {
            column[i] /= found->r[l][l];
        }
    }
    return true;
}

/* Put the modes where the squares of the distances[impact][stride] have their least sum. `place`: their displacements. */
static void put_in_place(const vi_orbit_response *response, const placing *placed, double distance[], int stride,
                         double place[])
{
    const int n = response->train->impacts;
    for (int l = 0; l < response->loose; ++l) {
        place[l] = 0.0;
        for (int i = 0; i < n; ++i) {
            place[l] -= placed->q[l][i] * distance[i * stride];
        }
        for (int i = 0; i < n; ++i) {
            distance[i * stride] += placed->q[l][i] * place[l];
        }
    }
    for (int l = response->loose - 1; l >= 0; --l) {
        for (int later = l + 1; later < response->loose; ++later) {
            place[l] -= placed->r[l][later] * place[later];
        }
        place[l] /= placed->r[l][l];
    }
}

/* Let the modes drift for one radian by the momentum that a train adds. The momentum follows from the speeds[impact]
 * [stride] and from `held` times the constant forces. The drift is 0 for an orbit. */
static void drift(const vi_orbit_response *response, const double speed[], double held, double distance[], int stride)
{
    const vi_orbit_body *body = response->body;
    const int n = response->train->impacts;
    for (int l = 0; l < response->loose; ++l) {
        double momentum = held * response->length * body->held[l];
        for (int k = 0; k < n; ++k) {
            const int32_t contact = response->train->contact[k];
            momentum -= (1.0 + body->restitution[contact]) * body->direction[contact] * speed[k * stride]
                        * body->impulse[(ptrdiff_t)contact * body->modes + l];
        }
        for (int i = 0; i < n; ++i) {
            const int32_t contact = response->train->contact[i];
            distance[i * stride] += body->direction[contact] * body->shape[(ptrdiff_t)contact * body->modes + l]
                                    * momentum / body->angular_frequency;
        }
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
    placing placed;
    if (!find_placing(&response, &placed)) {
        return VI_ORBIT_ADRIFT;
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
    double place[VI_MODES];
    put_in_place(&response, &placed, distance, 1, place);
    drift(&response, velocity, 1.0, distance, 1);
    for (int m = 0; m < n; ++m) {
        put_in_place(&response, &placed, distance_slope + m, n, place);
        drift(&response, velocity_slope + m, 0.0, distance_slope + m, n);
    }
    return VI_ORBIT_DONE;
}

VI_DOOR int vi_door_orbit_wave(const vi_orbit_body *body, const vi_orbit_train *train, double *level, double cosine[],
                               double sine[])
{
    vi_orbit_response response;
    const int refused = train->impacts == 1 ? vi_orbit_respond(&response, body, train) : VI_ORBIT_REFUSED;
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    placing placed;
    if (!find_placing(&response, &placed)) {
        return VI_ORBIT_ADRIFT;
    }
    double g[3], place[VI_MODES];
    answer(&response, 0, 0, g);
    if (!(fabs(1.0 - g[1]) > 0.0)) {
        return VI_ORBIT_SINGULAR;
    }
    const int32_t contact = train->contact[0];
    const double direction = body->direction[contact], none = 0.0;
    vi_orbit_gap gap;
    vi_orbit_steady_gap(&response, contact, &gap);
    *level = direction * (gap.level - body->position[contact]);
    put_in_place(&response, &placed, level, 1, place);
    drift(&response, &none, 1.0, level, 1);
    for (int k = 0; k < body->harmonics; ++k) {
        const double w = body->order[k] * body->angular_frequency;
        const double x[2] = {direction * gap.cosine[k], direction * gap.sine[k]};
        const double speed[2] = {w * x[1] / (1.0 - g[1]), -w * x[0] / (1.0 - g[1])};
        double *const part[2] = {&cosine[k], &sine[k]};
        for (int side = 0; side < 2; ++side) {
            *part[side] = x[side] + g[0] * speed[side];
            put_in_place(&response, &placed, part[side], 1, place);
            drift(&response, &speed[side], 0.0, part[side], 1);
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
        const double taken = (1.0 + body->restitution[contact]) * velocity[k] * body->direction[contact];
        double x[VI_MODES], v[VI_MODES];
        vi_orbit_train_answer(response, contact, k == i ? 0.0 : vi_orbit_since(response, i, k), x, v);
        for (int j = 0; j < body->modes; ++j) {
            state[j] += taken * x[j];
            state[body->modes + j] += taken * v[j];
        }
    }
}

/* Put the modes without a spring where the impacts are at their stops. */
static void place_states(const vi_orbit_response *response, const placing *placed, double state[])
{
    const vi_orbit_body *body = response->body;
    const int n = response->train->impacts;
    double distance[VI_ORBIT_IMPACTS], place[VI_MODES];
    for (int i = 0; i < n; ++i) {
        const int32_t contact = response->train->contact[i];
        double stop[3];
        vi_orbit_stop(body, contact, response->train->phase[i], stop);
        double at = -body->position[contact] - stop[0];
        for (int j = 0; j < body->modes; ++j) {
            at += body->shape[(ptrdiff_t)contact * body->modes + j] * state[(ptrdiff_t)i * 2 * body->modes + j];
        }
        distance[i] = body->direction[contact] * at;
    }
    put_in_place(response, placed, distance, 1, place);
    for (int i = 0; i < n; ++i) {
        for (int l = 0; l < response->loose; ++l) {
            state[(ptrdiff_t)i * 2 * body->modes + l] += place[l];
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
    placing placed;
    if (!find_placing(&response, &placed)) {
        return VI_ORBIT_ADRIFT;
    }
    const int modes = body->modes, states = 2 * modes, n = train->impacts;
    for (int i = 0; i < n; ++i) {
        after_impact(&response, velocity, i, state + (ptrdiff_t)i * states);
    }
    place_states(&response, &placed, state);
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
