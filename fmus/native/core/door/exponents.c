#include "door/exponents.h"

#include <math.h>
#include <string.h>

/* Make the columns orthonormal, one after the other, twice against rounding; add the logarithms of their lengths. */
static void orthonormalize(int n, double column[][VI_ORBIT_STATES], double stretch[])
{
    for (int k = 0; k < n; ++k) {
        for (int pass = 0; pass < 2; ++pass) {
            for (int before = 0; before < k; ++before) {
                double along = 0.0;
                for (int i = 0; i < n; ++i) {
                    along += column[i][before] * column[i][k];
                }
                for (int i = 0; i < n; ++i) {
                    column[i][k] -= along * column[i][before];
                }
            }
        }
        double square = 0.0;
        for (int i = 0; i < n; ++i) {
            square += column[i][k] * column[i][k];
        }
        const double length = sqrt(square);
        stretch[k] += log(length);
        for (int i = 0; i < n; ++i) {
            column[i][k] /= length;
        }
    }
}

/* Carry the state over a flight. Modes without a spring miss their constant forces: no impact depends on where they are
 * (equations.md 4.2). */
static void fly(const vi_orbit_response *response, double from, double to, double u, double state[])
{
    const int modes = response->body->modes;
    double x[VI_MODES], v[VI_MODES];
    vi_orbit_steady(response, from, x, v);
    for (int j = 0; j < modes; ++j) {
        state[j] -= x[j];
        state[modes + j] -= v[j];
    }
    vi_orbit_free(response, u, state, state + modes);
    vi_orbit_steady(response, to, x, v);
    for (int j = 0; j < modes; ++j) {
        state[j] += x[j];
        state[modes + j] += v[j];
    }
}

VI_DOOR int vi_door_exponents(const vi_orbit_body *body, const vi_orbit_run *run, int64_t first, int64_t last,
                              double state[], double directions[], double stretch[])
{
    vi_orbit_response response;
    double change[VI_ORBIT_STATES][VI_ORBIT_STATES];
    const int refused = vi_orbit_modes(&response, body);
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    if (first < 1 || last > run->impacts) {
        return VI_ORBIT_REFUSED;
    }
    const int modes = body->modes, states = 2 * modes;
    for (int row = 0; row < states; ++row) {
        memcpy(change[row], directions + (ptrdiff_t)row * states, (size_t)states * sizeof change[row][0]);
    }
    for (int64_t i = first; i < last; ++i) {
        const int32_t contact = run->contact[i];
        const double velocity = run->velocity[i], u = run->elapsed[i];
        if (contact < 0 || contact >= body->contacts || !(velocity > 0.0) || !(u >= 0.0) || !isfinite(u)) {
            return VI_ORBIT_REFUSED;
        }
        fly(&response, run->phase[i - 1], run->phase[i], u, state);
        double slope;
        const double equal = vi_orbit_equal_speed(body, contact, velocity, &slope);
        const double taken = (1.0 + body->restitution[contact]) * body->direction[contact] * equal;
        for (int j = 0; j < modes; ++j) {
            state[modes + j] -= taken * body->impulse[(ptrdiff_t)contact * modes + j];
        }
        vi_orbit_carry(&response, u, states, change);
        vi_orbit_salt(&response, contact, run->phase[i], velocity, state, states, change);
        orthonormalize(states, change, stretch);
    }
    for (int row = 0; row < states; ++row) {
        memcpy(directions + (ptrdiff_t)row * states, change[row], (size_t)states * sizeof change[row][0]);
    }
    return VI_ORBIT_DONE;
}
