/* Chirps cos(phi(t)) of amplitude 1, by their Taylor series: equations.md 8.9. */
#ifndef VIBROIMPACT_CHIRP_H
#define VIBROIMPACT_CHIRP_H

#include <stdbool.h>

#include "signals/piece.h"

/* The phase, rad, s seconds after the start: phase + w s + rate s^2 / 2, or phase + w (exp(rate s) - 1) / rate. */
typedef struct {
    bool logarithmic;
    double phase;             /* at the start, rad */
    double angular_frequency; /* w, at the start, rad/s; logarithmic: > 0 */
    vi_twofold rate;          /* rad/s^2; logarithmic: 1/s */
} vi_chirp;

/* A chirp from one angular frequency to another within `duration` s > 0. */
vi_chirp vi_chirp_of(bool logarithmic, double phase, double angular_frequency, double end_angular_frequency,
                     double duration);

/* The piece `since` seconds after the start, at most `length` seconds long. */
void vi_chirp_piece(const vi_chirp *chirp, vi_twofold since, double length, vi_piece *piece);

#endif
