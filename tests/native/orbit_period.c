/* Orbits whose period is unknown: derivatives of their errors against differences, of random bodies that grow. */
#include "door/orbit_period.h"

#include <math.h>
#include <string.h>

#include "check.h"
#include "orbit_case.h"

enum { UNKNOWNS = 2 * IMPACTS + 1, CASES = 300 };
static const double CHANGE = 1e-6;

/* Draw a body without a force, with negative springs and dashpots. */
static void draw_growing(uint64_t *seed, orbit_case *drawn)
{
    draw(seed, drawn);
    vi_orbit_body *body = &drawn->body;
    body->harmonics = 1;
    drawn->order[0] = 1.0;
    drawn->train.periods = 1;
    for (int j = 0; j < body->modes; ++j) {
        drawn->cosine[j] = drawn->sine[j] = 0.0;
        drawn->natural[j] *= choice(seed, 4) ? 1.0 : -1.0;
        drawn->damping_ratio[j] = uniform(seed, -0.1, 0.3);
    }
    for (int k = 0; k < body->contacts; ++k) {
        drawn->stop_cosine[k] = drawn->stop_sine[k] = 0.0;
    }
    for (int i = 0; i < drawn->train.impacts; ++i) {
        drawn->phase[i] = TURN * (i + uniform(seed, 0.0, 0.8)) / drawn->train.impacts;
    }
    if (choice(seed, 2)) {
        couple(seed, drawn);
        damping[0] -= uniform(seed, 0.0, 0.5); /* a dashpot that gives energy */
        const double rate = body->angular_frequency;
        CHECK(vi_door_orbit_couple(body->modes, 1, &rate, body->natural, damping, body->cosine, body->sine, &coupling,
                                   &work)
                  == 0,
              "%d modes", body->modes);
    }
}

/* Find the errors after a change of an unknown: a phase, a velocity, or the logarithm of the period. */
static int errors_beside(const orbit_case *drawn, const double velocity[], int unknown, double change, double error[])
{
    orbit_case other = *drawn;
    const int n = drawn->train.impacts;
    double speed[IMPACTS], slope[2 * IMPACTS * UNKNOWNS];
    memcpy(speed, velocity, sizeof speed);
    vi_orbit_body body = drawn->body;
    other.train.phase = other.phase;
    if (unknown < n) {
        other.phase[unknown] += change;
    } else if (unknown < 2 * n) {
        speed[unknown - n] += change;
    } else {
        body.angular_frequency *= exp(-change);
    }
    return vi_door_orbit_errors(&body, &other.train, speed, error, slope);
}

int main(void)
{
    uint64_t seed = 7;
    int done = 0;
    for (int number = 0; number < CASES; ++number) {
        orbit_case drawn;
        draw_growing(&seed, &drawn);
        const int n = drawn.train.impacts, stride = 2 * n + 1;
        double velocity[IMPACTS], error[2 * IMPACTS], slope[2 * IMPACTS * UNKNOWNS];
        double above[2 * IMPACTS], below[2 * IMPACTS];
        for (int i = 0; i < n; ++i) {
            velocity[i] = uniform(&seed, 0.6, 2.0);
        }
        if (vi_door_orbit_errors(&drawn.body, &drawn.train, velocity, error, slope) != VI_ORBIT_DONE) {
            continue;
        }
        double size = 1.0;
        for (int i = 0; i < 2 * n * stride; ++i) {
            size = fmax(size, fabs(slope[i]));
        }
        for (int unknown = 0; unknown < stride; ++unknown) {
            if (errors_beside(&drawn, velocity, unknown, CHANGE, above) != VI_ORBIT_DONE
                || errors_beside(&drawn, velocity, unknown, -CHANGE, below) != VI_ORBIT_DONE) {
                continue; /* next to a body that loses the digits of its growth */
            }
            for (int i = 0; i < 2 * n; ++i) {
                const double difference = (above[i] - below[i]) / (2.0 * CHANGE);
                CHECK(fabs(difference - slope[i * stride + unknown]) < 1e-5 * size, "case %d, unknown %d: %g for %g",
                      number, unknown, slope[i * stride + unknown], difference);
            }
        }
        ++done;
    }
    CHECK(done > CASES / 2, "%d cases", done);
    return 0;
}
