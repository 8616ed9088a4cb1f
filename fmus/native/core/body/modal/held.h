/* Contacts held on rigid stops: the forces that hold them, and the other contacts that they hold. */
#ifndef VIBROIMPACT_MODAL_HELD_H
#define VIBROIMPACT_MODAL_HELD_H

#include <stdbool.h>

#include "body/modal/coupled_flow.h"
#include "body/modal/state.h"

/* A contact that would be held at rest from now on: the state after a plastic impact, and the force to hold it. */
typedef struct {
    double p[VI_MODES];
    double impulse[VI_PORTS]; /* of that impact, N s */
    double mobility;         /* of the contact, with the other held contacts held, 1/kg */
    double pressure, slope, bend; /* acceleration towards the stop if released, m/s^2, and its first two rates */
    double noise;            /* of the pressure, and of the acceleration without other held contacts, m/s^2 */
    int first;               /* the first Taylor coefficient above rounding, counted from the slope (1) */
    double lead;             /* value of this coefficient; 0: none */
} vi_held_view;

void vi_structure_look_at_held(const vi_structure *s, int k, vi_held_view *view);

/* Mobility of contact k with the other held contacts held, at least a little, 1/kg. */
double vi_structure_mobility_left(const vi_structure *s, int k);

/* Do the other held contacts keep the point of contact k in place? */
bool vi_structure_is_kept(const vi_structure *s, int k);

/* Does contact k stand at its stop without any press now or later, since rigid stops hold its point there? */
bool vi_structure_only_touches(const vi_structure *s, int k);

/* Rounding of the modes' Taylor coefficients; each is the sum of larger terms made of the coefficients before it. */
typedef struct {
    const vi_structure *s;
    const vi_drift *drift;
    int n;                                   /* the next coefficient */
    double drive;                            /* size of coefficient n - 2 of the forcing, of amplitude 1 */
    double held[VI_MODES];                   /* constant loads */
    double before[VI_MODES], last[VI_MODES]; /* roundings of coefficients n - 2 and n - 1 */
} vi_series_noise;

void vi_series_noise_begin(vi_series_noise *noise, const vi_structure *s, const vi_drift *drift);

/* Rounding of the next coefficient of contact k's motion, from the third coefficient on, m/s^n. */
double vi_series_noise_next(vi_series_noise *noise, int k);

/* The first coefficient above rounding, from the slope on, of the force of held contact k; VI_ORDER + 1: none. */
int vi_structure_first_of_force(const vi_structure *s, const vi_drift *drift, int k);

#endif
