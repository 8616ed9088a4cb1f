#include "lanes/lanes.h"

#include <math.h>
#include <string.h>

#include "door/seconds.h"
#include "lanes/instructions.h"
#include "lanes/lane_run.h"
#include "lanes/many_coupling.h"
#include "lanes/yielding.h"

/* Rounds of attending the lanes between two readings of the clock. */
enum { ROUNDS_BETWEEN_READINGS = 64 };
/* Most rows written between two checks of their room: by the rounds, and when all lanes are attended once. A run that
 * ends may write its open contact too. */
enum { MOST_ROWS = (VI_MOST_ROUNDS + 2) * VI_LANES };

/* State that is kept between two calls. */
typedef struct {
    vi_lane_group group; /* first member: aligned like vectors */
    vi_lane_run run[VI_LANES];
    int64_t started;
} kept_state;

enum { ALIGNMENT = 64 }; /* of the state, bytes */

static void *aligned(void *memory)
{
    const uintptr_t place = ((uintptr_t)memory + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
    return (void *)place;
}

static bool is_plan(const vi_lanes_plan *plan)
{
    const int most = plan->yielding ? VI_ONE_MODE_CONTACTS : VI_LANES_CONTACTS;
    if (plan->modes < 1 || plan->modes > VI_LANES_MODES || plan->contacts < 0 || plan->contacts > most) {
        return false;
    }
    const int64_t contacts = ((int64_t)1 << plan->contacts) - 1, observed = (int64_t)1 << VI_LANES_CONTACTS;
    if (plan->coupled < 0 || plan->coupled > (plan->modes > 1)) {
        return false;
    }
    if (plan->further < 0 || plan->further > VI_FURTHER_SINES || (plan->further > 0 && plan->yielding)
        || vi_real_modes(plan) > VI_REAL_MODES) {
        return false;
    }
    return plan->yielding >= 0 && plan->yielding <= (plan->modes == 1 ? contacts : 0)
           && (plan->rate == 0.0 || (plan->rate > 0.0 && isfinite(plan->rate)))
           && (plan->sampled & ~(contacts | observed)) == 0 && vi_lanes_rounds_of(plan->instructions) != NULL;
}

VI_DOOR size_t vi_door_lanes_memory(const vi_lanes_plan *plan)
{
    if (!is_plan(plan)) {
        return 0;
    }
    return sizeof(kept_state) + ALIGNMENT + (plan->further ? sizeof(vi_lane_sines) + ALIGNMENT : 0)
           + (plan->coupled ? vi_lane_coupling_size() : 0);
}

VI_DOOR int vi_door_lanes_instructions(int set)
{
    return vi_lanes_instructions(set);
}

VI_DOOR void vi_door_lanes_impacts(const double *rows, const int64_t *owner, int64_t count, int64_t *next, int64_t total,
                                   double *columns)
{
    for (int64_t i = 0; i < count; ++i) {
        const int64_t place = next[owner[i]];
        if (place >= 0) {
            next[owner[i]] += 1;
            for (int column = 0; column < VI_IMPACT_WIDTH; ++column) {
                columns[column * total + place] = rows[i * VI_IMPACT_WIDTH + column];
            }
        }
    }
}

static bool works(const vi_lanes_work *work)
{
    bool found = false;
    for (int lane = 0; lane < VI_LANES; ++lane) {
        found = found || work->run[lane].point >= 0;
    }
    return found;
}

/* Begin points in the lanes without a point, as far as points can begin. */
static void take_all(vi_lanes_work *work)
{
    for (int lane = 0; lane < VI_LANES; ++lane) {
        bool takes = work->run[lane].point < 0;
        while (takes && work->run[lane].point < 0) {
            takes = vi_lane_take(work, lane);
        }
        if (work->run[lane].point < 0) {
            vi_lane_idle(work, lane);
        }
    }
}

static void begin(vi_lanes_work *work, kept_state *memory)
{
    if (memory->started) {
        return;
    }
    memset(memory, 0, sizeof *memory);
    memory->started = 1;
    void *after = memory + 1;
    if (work->plan->further) {
        memory->group.sines = aligned(after);
        memset(memory->group.sines, 0, sizeof *memory->group.sines);
        memory->group.sines->count = work->plan->further;
        after = memory->group.sines + 1;
    }
    if (work->plan->coupled) {
        memory->group.coupling = after;
        memset(memory->group.coupling, 0, vi_lane_coupling_size());
    }
    for (int lane = 0; lane < VI_LANES; ++lane) {
        vi_lane_idle(work, lane);
    }
}

static const vi_lane_body *body_of(const vi_lanes_plan *plan)
{
    if (plan->yielding) {
        return &vi_lane_yielding;
    }
    return plan->modes == 1 ? &vi_lane_one_mode : &vi_lane_many_modes;
}

VI_DOOR int vi_door_lanes(const vi_lanes_plan *plan, vi_lanes_points *points, void *memory)
{
    if (!is_plan(plan) || points->rows_room < VI_LANES_LEAST_ROOM) {
        return VI_LANES_REFUSED;
    }
    const double call = vi_seconds_now();
    const vi_lanes_rounds rounds = vi_lanes_rounds_of(plan->instructions);
    kept_state *now = aligned(memory);
    vi_lanes_work work = {plan, body_of(plan), points, &now->group, now->run, 0};
    begin(&work, now);
    for (int rounds_done = 0;; ++rounds_done) {
        if (points->rows_room - points->rows_used < MOST_ROWS) {
            return VI_LANES_FULL;
        }
        if (rounds_done == ROUNDS_BETWEEN_READINGS) {
            rounds_done = 0;
            if (vi_seconds_since(call) >= points->most_seconds) {
                return VI_LANES_LISTEN;
            }
        }
        take_all(&work);
        if (!works(&work)) {
            break;
        }
        rounds(&now->group, plan, points);
        for (int lane = 0; lane < VI_LANES; ++lane) {
            vi_lane_attend(&work, lane);
        }
    }
    for (int64_t i = 0; i < points->begun_below; ++i) {
        if (points->state[i] != VI_POINT_HAS_RUN && points->state[i] != VI_POINT_IS_ANSWERED) {
            return VI_LANES_LEFT;
        }
    }
    return VI_LANES_DONE;
}
