#include "door/orbit_period.h"

#include <math.h>
#include <stdbool.h>

#include "door/orbit_placing.h"

/* Change of the period's logarithm for its derivative, by differences of fourth order. Truncation and rounding are
 * about 1e-11 of the errors' size next to a pole; they cost Newton's method no digit. */
static const double CHANGE = 1e-4;

/* The impacts' answers g[i][k], with two derivatives, and the speeds of equal impulse, with their derivatives. */
typedef struct {
    vi_orbit_response response;
    vi_orbit_placing placed;
    double g[VI_ORBIT_IMPACTS][VI_ORBIT_IMPACTS][3], equal[VI_ORBIT_IMPACTS], share[VI_ORBIT_IMPACTS];
} answers;

/* Find the answers, and the errors of the impacts. Returns one of VI_ORBIT_*. */
static int find_errors(const vi_orbit_body *body, const vi_orbit_train *train, const double velocity[], answers *found,
                       double error[])
{
    const int n = train->impacts, refused = vi_orbit_respond(&found->response, body, train);
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    if (!vi_orbit_find_placing(&found->response, &found->placed)) {
        return VI_ORBIT_ADRIFT;
    }
    for (int k = 0; k < n; ++k) {
        found->equal[k] = vi_orbit_equal_speed(body, train->contact[k], velocity[k], &found->share[k]);
    }
    for (int i = 0; i < n; ++i) {
        double steady[3];
        vi_orbit_steady_at(&found->response, i, steady);
        error[i] = steady[0];
        error[n + i] = velocity[i] - steady[1];
        for (int k = 0; k < n; ++k) {
            vi_orbit_answer(&found->response, i, k, found->g[i][k]);
            error[i] += found->g[i][k][0] * found->equal[k];
            error[n + i] -= found->g[i][k][1] * found->equal[k];
        }
    }
    double place[VI_MODES];
    vi_orbit_put_in_place(&found->response, &found->placed, error, 1, place);
    vi_orbit_drift(&found->response, found->equal, 1.0, error, 1);
    return VI_ORBIT_DONE;
}

/* Set the derivatives of the errors of impact i over the phases and velocities of all impacts. */
static void set_slopes(const answers *known, int i, double distance[], double speed[])
{
    const int n = known->response.train->impacts;
    const double second = 1.0 / known->response.body->angular_frequency; /* per radian */
    double faster = 0.0, accelerated = 0.0;
    for (int k = 0; k < n; ++k) {
        const double *g = known->g[i][k];
        distance[k] = -g[1] * known->equal[k] * second;
        speed[k] = g[2] * known->equal[k] * second;
        distance[n + k] = g[0] * known->share[k];
        speed[n + k] = (i == k ? 1.0 : 0.0) - g[1] * known->share[k];
        faster += k == i ? 0.0 : g[1] * known->equal[k];
        accelerated += k == i ? 0.0 : g[2] * known->equal[k];
    }
    distance[i] = faster * second;
    speed[i] = -accelerated * second;
}

/* Set the derivative of the errors over the logarithm of the period, slope[2 impacts][stride]. */
static int set_period_slopes(const vi_orbit_body *body, const vi_orbit_train *train, const double velocity[],
                             answers *work, double slope[], int stride)
{
    const double places[4] = {-2.0, -1.0, 1.0, 2.0}, weights[4] = {1.0, -8.0, 8.0, -1.0};
    const int n = 2 * train->impacts;
    double error[2 * VI_ORBIT_IMPACTS];
    for (int i = 0; i < n; ++i) {
        slope[i * stride] = 0.0;
    }
    for (int k = 0; k < 4; ++k) {
        vi_orbit_body other = *body;
        other.angular_frequency *= exp(-places[k] * CHANGE);
        const int refused = find_errors(&other, train, velocity, work, error);
        if (refused != VI_ORBIT_DONE) {
            return refused;
        }
        for (int i = 0; i < n; ++i) {
            slope[i * stride] += weights[k] * error[i] / (12.0 * CHANGE);
        }
    }
    return VI_ORBIT_DONE;
}

VI_DOOR int vi_door_orbit_errors(const vi_orbit_body *body, const vi_orbit_train *train, const double velocity[],
                                 double error[], double slope[])
{
    answers known;
    const int refused = find_errors(body, train, velocity, &known, error);
    if (refused != VI_ORBIT_DONE) {
        return refused;
    }
    const int n = train->impacts, stride = 2 * n + 1;
    double place[VI_MODES];
    for (int i = 0; i < n; ++i) {
        set_slopes(&known, i, slope + (ptrdiff_t)i * stride, slope + (ptrdiff_t)(n + i) * stride);
    }
    for (int m = 0; m < 2 * n; ++m) {
        double faster[VI_ORBIT_IMPACTS] = {0.0};
        vi_orbit_put_in_place(&known.response, &known.placed, slope + m, stride, place);
        if (m >= n) {
            faster[m - n] = known.share[m - n];
            vi_orbit_drift(&known.response, faster, 0.0, slope + m, stride);
        }
    }
    return set_period_slopes(body, train, velocity, &known, slope + 2 * n, stride);
}
