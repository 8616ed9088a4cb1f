/* Contacts with stops that yield, in the rows of a record. */
#ifndef VIBROIMPACT_LANE_YIELDING_H
#define VIBROIMPACT_LANE_YIELDING_H

#include <stdbool.h>

#include "body/record.h"
#include "lanes/lane_body.h"
#include "motion/clock.h"

extern const vi_lane_body vi_lane_yielding;

/* Note the touch-down of a lane at this instant, whose contact is to be recorded. */
void vi_yielding_touch_down(vi_lane_group *group, int lane, vi_instant now);

/* Is a contact under way that is to be recorded? */
bool vi_yielding_is_open(const vi_lane_group *group, int lane);

/* Set the row of a contact that is still open; quantities known only at its end are NaN. */
void vi_yielding_open_row(const vi_lane_group *group, int lane, const vi_clock *clock, double unit,
                          double row[VI_RECORD_WIDTH]);

/* Set the rows of the contact that has ended at this instant: the impact, and its largest force. The arguments are the
 * lane's clock, metres per unit of q, and the impulse for a unit change of the contact's speed, kg. */
void vi_yielding_rows(vi_lane_group *group, int lane, const vi_clock *clock, vi_instant now, double unit, double impulse,
                      double rows[2][VI_RECORD_WIDTH]);

#endif
