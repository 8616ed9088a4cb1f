/* Certified time of a flight without contact, from samples at equal steps. equations.md 2
 *
 * A sample costs a few products, since the propagators over one to VI_SCAN_SAMPLES steps are made once and kept.
 * Between samples a point deviates by at most M step^4 / 384 from the cubic with their values and rates; M bounds its
 * fourth derivative. Modes that ripple by less are left out, and their ripple is subtracted. Where the cubic's control
 * points are clear by more, there is no contact. In the next interval a speed towards the stop without a zero proves
 * that there is at most one contact.
 */
#ifndef VIBROIMPACT_MODAL_SCAN_H
#define VIBROIMPACT_MODAL_SCAN_H

#include "body/modal/modal_flight.h"

enum { VI_SCAN_SAMPLES = 8, VI_SCAN_LEVELS = 16 }; /* samples of a block; lengths of steps */

/* Propagators over 1 to VI_SCAN_SAMPLES steps of one length. */
typedef struct {
    double step;                                             /* s; 0: the propagators are not made yet */
    double cosine[VI_SCAN_SAMPLES], sine[VI_SCAN_SAMPLES];   /* of the turn of the clock's phase */
    double further_cosine[VI_SINES_ROOM][VI_SCAN_SAMPLES], further_sine[VI_SINES_ROOM][VI_SCAN_SAMPLES];
    double x_of_x[VI_MODES][VI_SCAN_SAMPLES], x_of_v[VI_MODES][VI_SCAN_SAMPLES];
    double v_of_x[VI_MODES][VI_SCAN_SAMPLES], v_of_v[VI_MODES][VI_SCAN_SAMPLES];
} vi_scan_level;

/* Cache, no part of a body's state: its contents follow from the modes. */
struct vi_scan {
    int32_t modes;
    double angular_frequency, stiffness[VI_MODES], decay[VI_MODES]; /* of the modes for which it was made */
    int32_t sines;                                                  /* further sines, and their frequencies */
    double further[VI_SINES_ROOM];
    vi_scan_level level[VI_SCAN_LEVELS];                            /* each with twice the step of the level before */
};

typedef enum {
    VI_SCAN_CLEAR,   /* no contact up to the end of the flight */
    VI_SCAN_BRACKET, /* a contact of `contact` in low to high, none before; its speed there has no zero */
    VI_SCAN_STUCK    /* none up to `low`; then samples cannot decide */
} vi_scan_end;

typedef struct {
    int contact;
    double low, high; /* s after the start */
    double guess;     /* time of the contact, to some digits */
    int blocks;       /* number of blocks of samples taken */
} vi_scan_found;

/* Scan a flight without series from an instant with the approaches `first`. `looked_for`: watched contacts. */
vi_scan_end vi_scan_flight(vi_scan *scan, const vi_flight *flight, const vi_point points[], const int looked_for[],
                           const vi_flight_instant *from, const vi_approach first[], vi_scan_found *found);

#endif
