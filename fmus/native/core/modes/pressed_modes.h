/* Complex modes of a body whose damping is classical, while one point of it is held in place or presses a linear
 * stop.
 *
 *     q'' + D q' + W q + n F = 0,   F = stiffness n.q + damping n.q',  or n.q = 0 with F the force that keeps it so
 *
 * D and W diagonal, n the shape of the point. What couples the modes is of rank one: the rates s of the motions e^(s
 * t) are the zeros of 1/Z(s) + sum n_j^2 / (s^2 + D_j s + W_j), with Z = stiffness + damping s (none where the point
 * is held), and the vector of each is n_j / (s^2 + D_j s + W_j) for a force of -1. Each zero is kept as its distance
 * from a pole, so that vectors are exact for points close to a node too. equations.md 3.4, 6.9 */
#ifndef VIBROIMPACT_PRESSED_MODES_H
#define VIBROIMPACT_PRESSED_MODES_H

#include <stdbool.h>
#include <stdint.h>

#include "motion/complex.h"
#include "sizes.h"

/* A pair of conjugate rates is one term, a real rate too: some real ones have room beside one pair for each mode. */
enum { VI_TERMS = VI_MODES + 4 };

/* The body and what it presses. */
typedef struct {
    int32_t modes;
    int32_t held;              /* the point is held in place; stiffness and damping mean nothing */
    double stiffness, damping; /* of the stop, N/m, N s/m */
    double square[VI_MODES];   /* W: natural angular frequency squared, 1/s^2 */
    double decay[VI_MODES];    /* D/2, 1/s */
    double shape[VI_MODES];    /* n, kg^(-1/2) */
} vi_pressed_body;

typedef struct {
    int32_t modes, terms;
    vi_complex rate[VI_TERMS];              /* s, 1/s, slow ones first; im > 0 for a pair, 0 for a real rate */
    vi_complex vector[VI_TERMS][VI_MODES];  /* kg^(-1/2) m for a force of `force` */
    double force[VI_TERMS];                 /* -1; 0 for a mode that the point has no part in */
    vi_complex share[VI_TERMS];             /* 2 (a pair) or 1 over the term's norm: see vi_pressed_parts */
    double touch[VI_TERMS][2];              /* damping n.vector, complex: what a dashpot adds to that */
} vi_pressed_modes;

/* False where they cannot be told to the last digits: nearly equal rates, modes that are overdamped or nearly
 * critical. */
bool vi_pressed_modes_find(vi_pressed_modes *found, const vi_pressed_body *body);

/* The motion q(t) = Re sum part_m vector_m e^(rate_m t) that starts at displacement q with velocity p. */
void vi_pressed_parts(const vi_pressed_modes *modes, const vi_pressed_body *body, const double q[], const double p[],
                      vi_complex part[]);

/* Re sum part_m vector_m, and with each part times its rate: displacement and velocity. */
void vi_pressed_sum(const vi_pressed_modes *modes, const vi_complex part[], double q[], double p[]);

#endif
