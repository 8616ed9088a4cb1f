#include "motion/origin.h"

/* Decay rate times time above which a damped motion gets a new origin. Bounds taken at the origin stay tight below. */
static const double MOST_DECAY = 0.1;

static bool goes_on(const vi_origin *origin, const vi_segment *segment, double x, double v)
{
    const vi_mode *mode = segment->mode;
    return origin->known && !segment->series && x == origin->reached_x && v == origin->reached_v
           && segment->held == origin->held && segment->held_rate == 0.0 && vi_segment_degree(segment) == 1
           && mode->stiffness == origin->stiffness
           && mode->decay == origin->decay;
}

static bool same_instant(vi_instant a, vi_instant b)
{
    return a.periods == b.periods && a.rest == b.rest && a.rest_low == b.rest_low;
}

void vi_origin_follow(const vi_origin *origin, vi_segment *segment, const vi_clock *clock, vi_instant now, double x,
                      double v, vi_since *since)
{
    if (!goes_on(origin, segment, x, v)) {
        return;
    }
    if (!(since->high > 0.0 && same_instant(since->at, origin->at))) {
        since->at = origin->at;
        since->high = vi_clock_elapsed_twofold(clock, origin->at, now, &since->low);
    }
    if (segment->mode->decay * since->high <= MOST_DECAY) {
        vi_segment_continue(segment, origin->x, origin->v, origin->amplitude, since->high, since->low);
    }
}

void vi_origin_reach(vi_origin *origin, const vi_segment *segment, vi_instant start, double x, double v)
{
    const vi_mode *mode = segment->mode;
    if (segment->series || mode->regime != VI_UNDERDAMPED || vi_mode_grows(mode) || segment->held_rate != 0.0
        || vi_segment_degree(segment) > 1) {
        *origin = (vi_origin){.known = 0};
        return;
    }
    if (segment->since == 0.0) {
        *origin = (vi_origin){.at = start,
                              .x = segment->x,
                              .v = segment->v,
                              .amplitude = segment->amplitude,
                              .held = segment->held,
                              .stiffness = mode->stiffness,
                              .decay = mode->decay,
                              .known = 1};
    }
    origin->reached_x = x;
    origin->reached_v = v;
}
