/* Contacts that are held on rigid stops: what holds them, and whom they hold in turn. */
#ifndef VIBROIMPACT_MODAL_HELD_H
#define VIBROIMPACT_MODAL_HELD_H

#include <stdbool.h>

#include "body/modal/coupled_flow.h"
#include "body/modal/state.h"

/* A contact held at rest from now on: the plastic state, and the force that would hold it. */
typedef struct {
    double p[VI_MODES];
    double mobility;         /* of the contact with those held beside it, 1/kg */
    double pressure, slope, bend; /* acceleration towards the stop if it were free, and its rates, m/s^2, .. m/s^4 */
    double noise;            /* of the pressure, and of the acceleration with no contact held beside it, m/s^2 */
    int first;               /* the first Taylor coefficient, from the slope (1) on, that is more than rounding */
    double lead;             /* that one; 0: none */
} vi_held_view;

void vi_structure_look_at_held(const vi_structure *s, int k, vi_held_view *view);

/* What the contacts that are held beside contact k leave of its mobility, at least a little, 1/kg. */
double vi_structure_mobility_left(const vi_structure *s, int k);

/* Is the point of contact k kept in place by the contacts that are held beside it? */
bool vi_structure_is_kept(const vi_structure *s, int k);

/* Does contact k stand at its stop, neither pressed in nor going to be, since rigid stops hold its point there? */
bool vi_structure_only_touches(const vi_structure *s, int k);

/* Rounding of the modes' Taylor coefficients, each the sum of larger terms made of those before it. */
typedef struct {
    const vi_structure *s;
    const vi_drift *drift;
    int n;                                   /* the coefficient that comes next */
    double drive;                            /* size of coefficient n - 2 of the forcing, of amplitude 1 */
    double held[VI_MODES];                   /* constant loads */
    double before[VI_MODES], last[VI_MODES]; /* rounding of coefficients n - 2 and n - 1 */
} vi_series_noise;

void vi_series_noise_begin(vi_series_noise *noise, const vi_structure *s, const vi_drift *drift);

/* Rounding of the next coefficient of contact k's motion, from the third one on, m/s^n. */
double vi_series_noise_next(vi_series_noise *noise, int k);

/* The first coefficient, from the slope on, of the force of held contact k that is more than rounding; VI_ORDER + 1: none. */
int vi_structure_first_of_force(const vi_structure *s, const vi_drift *drift, int k);

#endif
