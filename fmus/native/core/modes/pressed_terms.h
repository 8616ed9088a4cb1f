/* A body held by stops or pressing them, as a sum of terms that decay independently.
 *
 *     q'' + D q' + W q + sum_k n_k F_k = 0,   F_k = stiffness n_k.q + damping n_k.q',  or n_k.q = 0 with F_k the force that
 *     keeps it so
 *
 * W is diagonal, D is the damping of the modes, and n_k are the contacts' shapes, towards their stops. A term is a
 * motion vector e^(rate t): (rate^2 + rate D + W) vector = -sum_k n_k force_k. All these matrices are symmetric, so the
 * vectors themselves split a motion into terms. pressed_modes and coupled_modes find the terms.
 */
#ifndef VIBROIMPACT_PRESSED_TERMS_H
#define VIBROIMPACT_PRESSED_TERMS_H

#include <stdbool.h>
#include <stdint.h>

#include "motion/complex.h"
#include "sizes.h"

/* Largest number of terms; a term is a pair of conjugate rates or a real rate. */
enum { VI_TERMS = 2 * VI_MODES };

/* The body and its present stops. */
typedef struct {
    int32_t modes, contacts;
    int32_t held[VI_PORTS];                        /* held in place; its stiffness and damping are unused */
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
    vi_complex force[VI_TERMS][VI_PORTS];  /* of the stops, for this vector */
    vi_complex share[VI_TERMS];            /* 2 (a pair) or 1, divided by the term's norm: see vi_pressed_parts */
    vi_complex pull[VI_TERMS][VI_MODES];   /* rate vector + D vector + sum_k damping_k n_k (n_k.vector) */
} vi_pressed_modes;

/* (D x)_j */
double vi_pressed_drag(const vi_pressed_body *body, int j, const double x[]);

void vi_pressed_terms_sort(vi_pressed_modes *modes);

/* Do the vectors give all motions? Two motions decide: one of all displacements and one of all velocities. */
bool vi_pressed_terms_are_complete(const vi_pressed_modes *modes, const vi_pressed_body *body);

/* Split the motion q(t) = Re sum part_m vector_m e^(rate_m t) from displacement q and velocity p into its parts. */
void vi_pressed_parts(const vi_pressed_modes *modes, const double q[], const double p[], vi_complex part[]);

/* Sum the parts: displacement Re sum part_m vector_m, and velocity with each part times its rate. */
void vi_pressed_sum(const vi_pressed_modes *modes, const vi_complex part[], double q[], double p[]);

#endif
