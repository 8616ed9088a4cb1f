/* The record a body keeps of its impacts, sticks and periods while an importer takes long steps.
 *
 * Rows of eight numbers, appended only. The importer reads `count` and `rows`, and says how many rows it has taken
 * by the input `taken`; they leave at once. Switched off, it costs one test.
 */
#ifndef VIBROIMPACT_RECORD_H
#define VIBROIMPACT_RECORD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sizes.h"

/* One event writes two rows at most for each contact, and one of a period. */
enum { VI_RECORD_CAPACITY = 512, VI_RECORD_WIDTH = 8, VI_RECORD_RESERVE = 2 * VI_PORTS + 1 };
enum { VI_ROW_IMPACT = 1, VI_ROW_STICK = 2, VI_ROW_PERIOD = 3, VI_ROW_PEAK = 4 };

typedef struct {
    /* inputs */
    int32_t impacts, extrema, periods;
    int32_t recording; /* impacts or periods are written: a recording goes on */
    int64_t taken;
    /* outputs */
    double displacement_max, displacement_min; /* m */
    int64_t count, dropped;
    int64_t told; /* the importer has been told that it is full, and has not emptied it since */
    /* the period now open */
    int32_t open;       /* extremes are being followed */
    int32_t period_open;
    double period_start; /* s */
    double strobe_displacement, strobe_velocity;
    int64_t period_impacts;
    double rows[VI_RECORD_CAPACITY * VI_RECORD_WIDTH]; /* last: only the used part is saved with a state */
} vi_record;

/* Drop the first `taken` rows: the importer has them. */
void vi_record_take(vi_record *record);

/* Start of a step: open or close what the importer switched on or off. Does a recording begin? */
bool vi_record_begin_step(vi_record *record, double displacement);

/* The importer has set an input: a recording ends where both of its switches are off, be it for no step. */
void vi_record_switched(vi_record *record);

/* Is there too little room for what one event may write? */
bool vi_record_full(const vi_record *record);

/* Does a step end here, as the record is full? Once: what the importer does not empty would end its steps for ever. */
bool vi_record_ends_step(vi_record *record);

void vi_record_impact(vi_record *record, double time, double phase, double velocity, double impulse, int contact,
                      double restitution);
/* The whole contact with a compliant stop, written when it ends; its duration in s, its largest force in N, in a row of
 * its own after that of the impact. Its period has counted it before. */
void vi_record_contact(vi_record *record, double time, double phase, double velocity, double impulse, int contact,
                       double restitution, double duration, double peak_force);
void vi_record_stick(vi_record *record, double start, double end, int contact, double tail_impulse);

/* Let the extremes know of a displacement that the body has. */
void vi_record_extend(vi_record *record, double displacement);

/* A forcing period begins: write the one that ends (if it was followed from its start) and open the next. */
void vi_record_period(vi_record *record, double time, double displacement, double velocity);

/* Bytes at the end of the record that hold no rows. */
size_t vi_record_unused(const vi_record *record);

#endif
