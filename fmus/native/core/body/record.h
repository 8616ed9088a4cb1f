/* A body's record of its impacts, sticks and periods, for importers that take long steps.
 *
 * Rows of eight numbers, appended only. The importer reads `count` and `rows`, and sets the input `taken` to the number
 * of rows it has read; these rows are then removed. Switched off, the record costs one test.
 */
#ifndef VIBROIMPACT_RECORD_H
#define VIBROIMPACT_RECORD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sizes.h"

/* Rows kept free: one event writes at most two rows for each contact and one row of a period. */
enum { VI_RECORD_CAPACITY = 512, VI_RECORD_WIDTH = 8, VI_RECORD_RESERVE = 2 * VI_PORTS + 1 };
enum { VI_ROW_IMPACT = 1, VI_ROW_STICK = 2, VI_ROW_PERIOD = 3, VI_ROW_PEAK = 4, VI_ROW_FURTHER = 5 };

/* The open period of a further observed point. */
typedef struct {
    double displacement_max, displacement_min, strobe_displacement, strobe_velocity;
} vi_record_point;

typedef struct {
    /* inputs */
    int32_t impacts, extrema, periods;
    int32_t recording; /* impacts or periods are being written */
    int64_t taken;
    /* outputs */
    double displacement_max, displacement_min; /* m */
    int64_t count, dropped;
    int64_t reported; /* the importer knows that the record is full, and has not emptied it since */
    /* the open period */
    int32_t open;       /* extremes are being followed */
    int32_t period_open;
    double period_start; /* s */
    double strobe_displacement, strobe_velocity;
    int64_t period_impacts;
    int64_t further; /* number of further observed points, set by the component */
    vi_record_point point[VI_PORTS];
    double rows[VI_RECORD_CAPACITY * VI_RECORD_WIDTH]; /* last member: only the used part is saved with a state */
} vi_record;

/* Drop the first `taken` rows, which the importer has read. */
void vi_record_take(vi_record *record);

/* Start a step: open or close the recordings that the importer switched on or off. Does a recording begin? */
bool vi_record_begin_step(vi_record *record, double displacement);

/* The importer has set an input. A recording ends once both of its switches are off, even if no step lies between. */
void vi_record_switched(vi_record *record);

/* Is there too little room for the rows of one event? */
bool vi_record_full(const vi_record *record);

/* Does a step end here because the record is full? Once, as a record that is never emptied would end all steps. */
bool vi_record_ends_step(vi_record *record);

void vi_record_impact(vi_record *record, double time, double phase, double velocity, double impulse, int contact,
                      double restitution);
/* Write the whole contact with a compliant stop when it ends: duration in s, largest force in N. The row follows the
 * row of the impact. The period of the impact has counted it already. */
void vi_record_contact(vi_record *record, double time, double phase, double velocity, double impulse, int contact,
                       double restitution, double duration, double peak_force);
void vi_record_stick(vi_record *record, double start, double end, int contact, double tail_impulse);

/* Extend the extremes to a displacement of the body. */
void vi_record_extend(vi_record *record, double displacement);

/* A recording of extremes begins in this step: a further observed point is at this displacement. */
void vi_record_point_begin(vi_record *record, int point, double displacement);

/* Extend the extremes of a further observed point. */
void vi_record_point_extend(vi_record *record, int point, double displacement);

/* A forcing period begins for a further observed point; called before vi_record_period, which closes the period. */
void vi_record_point_period(vi_record *record, int point, double displacement, double velocity);

/* A forcing period begins: write the ending period (if it was followed from its start) and open the next. */
void vi_record_period(vi_record *record, double time, double displacement, double velocity);

/* Bytes of unused rows at the end of the record. */
size_t vi_record_unused(const vi_record *record);

#endif
