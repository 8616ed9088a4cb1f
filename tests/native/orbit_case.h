/* A random body on a periodic orbit of random impacts, with modes that the damping couples or not. */
#ifndef ORBIT_CASE_H
#define ORBIT_CASE_H

#include "check.h"
#include "door/orbits.h"

enum { MODES = 6, CONTACTS = 3, IMPACTS = 4, HARMONICS = 3 };

static const double TURN = 6.283185307179586;

typedef struct {
    vi_orbit_body body;
    vi_orbit_train train;
    double natural[MODES], damping_ratio[MODES], held[MODES];
    double order[HARMONICS], cosine[HARMONICS * MODES], sine[HARMONICS * MODES];
    double stop_cosine[HARMONICS * CONTACTS], stop_sine[HARMONICS * CONTACTS];
    double shape[CONTACTS * MODES], impulse[CONTACTS * MODES];
    double direction[CONTACTS], position[CONTACTS], restitution[CONTACTS], yield_velocity[CONTACTS];
    int32_t contact[IMPACTS];
    double phase[IMPACTS];
} orbit_case;

/* Damping between the modes of the present case, with its complex modes. */
static double damping[MODES * MODES];
static vi_orbit_coupling coupling;
static vi_coupled_work work;

static double random_ratio(uint64_t *seed)
{
    const double ratios[] = {0.0, 1.0, 1.0 - 1e-9, 1.0 + 1e-9, uniform(seed, 0.0, 0.3), uniform(seed, 0.3, 3.0)};
    return ratios[choice(seed, 6)];
}

/* Draw the sines of the force and of the stops; some stops do not move. */
static void draw_sines(uint64_t *seed, orbit_case *drawn)
{
    const vi_orbit_body *body = &drawn->body;
    for (int k = 0; k < body->harmonics; ++k) {
        drawn->order[k] = (k > 0 ? drawn->order[k - 1] : 0.0) + 1.0 + choice(seed, 3);
        for (int j = 0; j < body->modes; ++j) {
            drawn->cosine[k * body->modes + j] = uniform(seed, -1.0, 1.0);
            drawn->sine[k * body->modes + j] = uniform(seed, -1.0, 1.0);
        }
        for (int contact = 0; contact < body->contacts; ++contact) {
            const double amplitude = choice(seed, 2) ? uniform(seed, 0.0, 0.5) : 0.0;
            drawn->stop_cosine[k * body->contacts + contact] = amplitude * uniform(seed, -1.0, 1.0);
            drawn->stop_sine[k * body->contacts + contact] = amplitude * uniform(seed, -1.0, 1.0);
        }
    }
}

static void draw(uint64_t *seed, orbit_case *drawn)
{
    vi_orbit_body *body = &drawn->body;
    *body = (vi_orbit_body){.modes = 1 + (int)choice(seed, MODES),
                            .contacts = 1 + (int)choice(seed, CONTACTS),
                            .harmonics = 1 + (int)choice(seed, HARMONICS),
                            .angular_frequency = uniform(seed, 0.4, 3.0),
                            .natural = drawn->natural,
                            .damping_ratio = drawn->damping_ratio,
                            .order = drawn->order,
                            .cosine = drawn->cosine,
                            .sine = drawn->sine,
                            .held = drawn->held,
                            .shape = drawn->shape,
                            .impulse = drawn->impulse,
                            .direction = drawn->direction,
                            .position = drawn->position,
                            .stop_cosine = drawn->stop_cosine,
                            .stop_sine = drawn->stop_sine,
                            .restitution = drawn->restitution,
                            .yield_velocity = drawn->yield_velocity};
    for (int j = 0; j < body->modes; ++j) {
        drawn->natural[j] = uniform(seed, 0.3, 6.0);
        drawn->damping_ratio[j] = random_ratio(seed);
        drawn->held[j] = uniform(seed, -0.2, 0.2);
    }
    for (int k = 0; k < body->contacts; ++k) {
        double square = 0.0;
        for (int j = 0; j < body->modes; ++j) {
            drawn->shape[k * body->modes + j] = uniform(seed, 0.2, 1.0) * (choice(seed, 2) ? 1.0 : -1.0);
            square += drawn->shape[k * body->modes + j] * drawn->shape[k * body->modes + j];
        }
        for (int j = 0; j < body->modes; ++j) {
            drawn->impulse[k * body->modes + j] = drawn->shape[k * body->modes + j] / square;
        }
        drawn->direction[k] = choice(seed, 2) ? 1.0 : -1.0;
        drawn->position[k] = uniform(seed, -0.5, 1.0);
        drawn->restitution[k] = uniform(seed, 0.0, 1.0);
        drawn->yield_velocity[k] = choice(seed, 2) ? uniform(seed, 0.01, 0.5) : 0.0;
    }
    draw_sines(seed, drawn);
    drawn->train = (vi_orbit_train){.impacts = 1 + (int)choice(seed, IMPACTS),
                                    .periods = 1 + (int)choice(seed, 3),
                                    .contact = drawn->contact,
                                    .phase = drawn->phase};
    const double slot = TURN * drawn->train.periods / drawn->train.impacts;
    for (int i = 0; i < drawn->train.impacts; ++i) {
        drawn->contact[i] = (int32_t)choice(seed, (unsigned)body->contacts);
        drawn->phase[i] = slot * (i + uniform(seed, 0.0, 0.8));
    }
}

/* Let dashpots between random points couple the modes. */
static void couple(uint64_t *seed, orbit_case *drawn)
{
    vi_orbit_body *body = &drawn->body;
    const int modes = body->modes;
    for (int j = 0; j < modes * modes; ++j) {
        damping[j] = 0.0;
    }
    for (int dashpot = 0; dashpot < 1 + (int)choice(seed, MODES); ++dashpot) {
        double at[MODES];
        for (int j = 0; j < modes; ++j) {
            at[j] = uniform(seed, -1.0, 1.0);
        }
        for (int j = 0; j < modes * modes; ++j) {
            damping[j] += at[j / modes] * at[j % modes];
        }
    }
    for (int j = 0; j < modes; ++j) {
        drawn->damping_ratio[j] = damping[j * modes + j] / (2.0 * drawn->natural[j]);
    }
    if (choice(seed, 3) == 0) { /* next to critical damping of one mode, or at it */
        const double off[] = {0.0, 1e-12, 1e-9, 1e-6, 1e-3};
        for (int i = 1; i < modes; ++i) {
            damping[i] = damping[i * modes] = 0.0;
        }
        damping[0] = 2.0 * drawn->natural[0] * (1.0 + off[choice(seed, 5)]);
        drawn->damping_ratio[0] = damping[0] / (2.0 * drawn->natural[0]);
    }
    double rate[HARMONICS];
    for (int k = 0; k < body->harmonics; ++k) {
        rate[k] = body->order[k] * body->angular_frequency;
    }
    CHECK(vi_door_orbit_couple(modes, body->harmonics, rate, body->natural, damping, body->cosine, body->sine,
                               &coupling, &work)
              == 0,
          "%d modes", modes);
    body->coupling = &coupling;
}

#endif
