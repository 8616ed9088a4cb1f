/* The force of an electromagnet that pulls at a body, or of a shaker that is fixed to it. */
#ifndef VIBROIMPACT_MAGNET_H
#define VIBROIMPACT_MAGNET_H

enum { VI_MAGNET_LOWER = 1, VI_MAGNET_UPPER = 2 };

typedef struct {
    double gain;     /* N/V, at displacement 0 */
    double offset;   /* N, likewise: what it pulls with at 0 V */
    double distance; /* m, between body and exciter at displacement 0; 0: the force does not depend on it */
    int side;        /* VI_MAGNET_LOWER: below the body, nearer where the displacement is negative */
} vi_magnet;

/* Distance of a body at `displacement` over the one at 0; <= 0: they touch. */
double vi_magnet_gap(const vi_magnet *magnet, double displacement);

/* (gain volts + offset) / gap^2, N; the gap is > 0. */
double vi_magnet_force(const vi_magnet *magnet, double volts, double displacement);

#endif
