/* Requests of an importer for a step, and the results of steps, for all bodies. */
#ifndef VIBROIMPACT_STEP_H
#define VIBROIMPACT_STEP_H

#include <stdbool.h>

typedef enum {
    VI_STEP_DONE = 0,         /* the end of the step is reached */
    VI_STEP_CONTACT = 1,      /* stopped at a contact with an external law; an event must resolve it */
    VI_STEP_RECORD_FULL = 2,  /* stopped early because the record has no more room */
    VI_STEP_IMPACT_LIMIT = 3, /* stopped early: impact_limit events of contacts since the start */
    VI_STEP_ERROR = 4,        /* misuse; the state is unchanged */
    VI_STEP_STANDSTILL = 5,   /* stopped early: VI_MOST_EVENTS events at one instant; stepping on would not end */
    VI_STEP_CRAWL = 6,        /* stopped early: long work has advanced time by no more than its rounding */
    VI_STEP_NOT_FINITE = 7,   /* stopped early: the motion goes beyond the largest numbers */
    VI_STEP_UNFINISHED = 8,   /* stopped early after the most work of a step; the next step continues */
    VI_STEP_UNBOUNDED = 9,    /* stopped early: a motion that grows has met its limit, or can meet no stop any more */
    VI_STEP_STROBE = 10       /* stopped early: a clock ticks here */
} vi_step_result;

/* Can the component make no further step? Its message gives the reason. */
static inline bool vi_step_failed(vi_step_result result)
{
    return result >= VI_STEP_ERROR && result <= VI_STEP_NOT_FINITE;
}

typedef struct {
    double time;            /* communication point, s */
    double size;            /* communication step, s, > 0 */
    bool stop_at_contacts;  /* FMI 3.0 event mode: end the step at an external contact */
    bool early_return;      /* may the step end before time + size for other reasons? */
} vi_step_request;

#endif
