/* How far a flight has no contact for certain, told by samples of it at equal steps.
 *
 * A sample costs a few products, since the propagators over one to VI_SCAN_SAMPLES steps are made once and kept. Between
 * two samples a point lies no further than M step^4 / 384 off the cubic that has the values and rates of both, M being a
 * bound of its fourth derivative; modes that ripple by less than that are let out, and their ripple is taken off. Where
 * the points that control the cubic are clear by more there is no contact. In the interval that is not cleared so, a
 * speed towards the stop that has no zero tells that there is one contact or none.
 * equations.md 2
 */
#ifndef VIBROIMPACT_MODAL_SCAN_H
#define VIBROIMPACT_MODAL_SCAN_H

#include "body/modal/modal_flight.h"

enum { VI_SCAN_SAMPLES = 8, VI_SCAN_LEVELS = 16 };

/* Propagators over 1 to VI_SCAN_SAMPLES steps of one length. */
typedef struct {
    double step;                                             /* s; 0: they are not made yet */
    double cosine[VI_SCAN_SAMPLES], sine[VI_SCAN_SAMPLES];   /* of the turn of the forcing phase */
    double x_of_x[VI_MODES][VI_SCAN_SAMPLES], x_of_v[VI_MODES][VI_SCAN_SAMPLES];
    double v_of_x[VI_MODES][VI_SCAN_SAMPLES], v_of_v[VI_MODES][VI_SCAN_SAMPLES];
} vi_scan_level;

/* No part of a body's state: what is kept follows from its modes. */
struct vi_scan {
    int32_t modes;
    double angular_frequency, stiffness[VI_MODES], decay[VI_MODES]; /* that it was made for */
    vi_scan_level level[VI_SCAN_LEVELS];                            /* each of twice the step of the one before */
};

typedef enum {
    VI_SCAN_CLEAR,   /* no contact up to the end of the flight */
    VI_SCAN_BRACKET, /* none up to `low`; one of `contact` between it and `high`, the speed towards the stop having no zero */
    VI_SCAN_STUCK    /* none up to `low`; then samples do not tell */
} vi_scan_end;

typedef struct {
    int contact;
    double low, high; /* s after the start */
    double guess;     /* where the contact is to some digits */
    int blocks;       /* of samples that were taken */
} vi_scan_found;

/* Scan a flight without series from an instant of it, at which the contacts' approaches are these. `looked_for[k]`: is
 * contact k; `rate`: the fastest of any mode, rad/s. */
vi_scan_end vi_scan_flight(vi_scan *scan, const vi_flight *flight, const vi_point points[], const int looked_for[],
                           const vi_flight_instant *from, const vi_approach first[], vi_scan_found *found);

#endif
