/* Force of an electromagnet that pulls at a body, or of a shaker that is fixed to it. */
#ifndef VIBROIMPACT_MAGNET_H
#define VIBROIMPACT_MAGNET_H

enum { VI_MAGNET_LOWER = 1, VI_MAGNET_UPPER = 2 };

typedef struct {
    double gain;     /* N/V, at displacement 0 */
    double offset;   /* N, at displacement 0 and 0 V */
    double distance; /* between body and exciter at displacement 0, m; 0: the force does not depend on it */
    int side;        /* VI_MAGNET_LOWER: below the body, closer at negative displacements */
} vi_magnet;

/* Distance of a body at `displacement` relative to the distance at displacement 0; <= 0: they touch. */
double vi_magnet_gap(const vi_magnet *magnet, double displacement);

/* (gain volts + offset) / gap^2, N; the gap must be > 0. */
double vi_magnet_force(const vi_magnet *magnet, double volts, double displacement);

#endif
