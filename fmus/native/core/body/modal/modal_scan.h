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
#include "body/modal/scan_levels.h"

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
