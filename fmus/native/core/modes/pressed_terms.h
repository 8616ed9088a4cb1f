/* A body that rests on stops, held by them or pressing them, as the sum of terms that decay each on its own.
 *
 *     q'' + D q' + W q + sum_k n_k F_k = 0,   F_k = stiffness n_k.q + damping n_k.q',  or n_k.q = 0 with F_k the force that
 *     keeps it so
 *
 * with W diagonal, D the damping of the modes, n_k the shapes of the contacts, towards their stops. A term is a motion
 * vector e^(rate t): (rate^2 + rate D + W) vector = -sum_k n_k force_k. D and all of this are symmetric, so that a motion
 * is taken apart by the vectors themselves. pressed_modes and coupled_modes find the terms. */
#ifndef VIBROIMPACT_PRESSED_TERMS_H
#define VIBROIMPACT_PRESSED_TERMS_H

#include <stdbool.h>
#include <stdint.h>

#include "motion/complex.h"
#include "sizes.h"

/* A pair of conjugate rates is one term, a real rate too. */
enum { VI_TERMS = 2 * VI_MODES };

/* The body and the stops that it rests on. */
typedef struct {
    int32_t modes, contacts;
    int32_t held[VI_PORTS];                        /* the contact is held in place; its stiffness and damping mean nothing */
    double stiffness[VI_PORTS], damping[VI_PORTS]; /* of the stops, N/m, N s/m */
    double square[VI_MODES];                       /* W: natural angular frequency squared, 1/s^2 */
    double decay[VI_MODES];                        /* D/2 where it is diagonal, 1/s */
    double shape[VI_PORTS][VI_MODES];              /* n, kg^(-1/2) */
    int32_t coupled;                               /* the damping couples the modes: coupling[][] is D */
    double coupling[VI_MODES][VI_MODES];           /* 1/s; only read when coupled */
} vi_pressed_body;

typedef struct {
    int32_t modes, terms;
    vi_complex rate[VI_TERMS];             /* 1/s, slow ones first; im > 0 for a pair, 0 for a real rate */
    vi_complex vector[VI_TERMS][VI_MODES]; /* kg^(-1/2) m */
    vi_complex force[VI_TERMS][VI_PORTS];  /* of the stops for that vector */
    vi_complex share[VI_TERMS];            /* 2 (a pair) or 1 over the term's norm: see vi_pressed_parts */
    vi_complex pull[VI_TERMS][VI_MODES];   /* rate vector + D vector + sum_k damping_k n_k (n_k.vector) */
} vi_pressed_modes;

/* (D x)_j */
double vi_pressed_drag(const vi_pressed_body *body, int j, const double x[]);

void vi_pressed_terms_sort(vi_pressed_modes *modes);

/* Do the vectors tell all motions? Two of them, one of all displacements and one of all velocities, tell. */
bool vi_pressed_terms_are_complete(const vi_pressed_modes *modes, const vi_pressed_body *body);

/* The motion q(t) = Re sum part_m vector_m e^(rate_m t) that starts at displacement q with velocity p. */
void vi_pressed_parts(const vi_pressed_modes *modes, const double q[], const double p[], vi_complex part[]);

/* Re sum part_m vector_m, and with each part times its rate: displacement and velocity. */
void vi_pressed_sum(const vi_pressed_modes *modes, const vi_complex part[], double q[], double p[]);

#endif
