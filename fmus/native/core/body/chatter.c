#include "body/chatter.h"

#include <math.h>

#include "body/landing.h"

/* Speed after an impact, relative to the fastest approach of the sequence. Below it the remaining chatter is summed;
 * above it impacts are resolved one by one. */
static const double TAIL_VELOCITY = 1e-4;
/* Largest error of the summed time, in units of 1 / fastest rate; a larger estimate keeps the impacts resolved. */
static const double TAIL_ERROR = 1e-16;
/* Height of a bounce, in resolutions of displacements, below which it cannot be followed: the body sticks. */
static const double LOWEST_BOUNCE = 8.0;
/* Low impacts in a row after which the body sticks. Only a restitution (almost) 1 reaches this number: its chatter has
 * no end, or none within reach. */
static const int64_t MOST_LOW_IMPACTS = 4000000;

bool vi_chatter_is_low(double pressure, double speed, double fastest)
{
    return pressure > 0.0 && 2.0 * speed * fastest < VI_LOW_BOUNCE * pressure;
}

bool vi_chatter_is_graze(double approach, double acceleration, double resolution)
{
    return approach * approach <= 2.0 * fabs(acceleration) * resolution;
}

bool vi_chatter_count(double *fastest_impact, int64_t *low_impacts, double approach, double rebound, bool graze,
                      bool tiny)
{
    *fastest_impact = vi_max(*fastest_impact, approach);
    const bool far_down = rebound <= TAIL_VELOCITY * *fastest_impact || graze;
    *low_impacts = far_down || tiny ? *low_impacts + 1 : 0;
    return far_down || *low_impacts > MOST_LOW_IMPACTS;
}

/* The end of a chatter sequence. */
typedef struct {
    double duration; /* s */
    double error;    /* estimate of the third-order term, s */
    bool complete;   /* the pressure lasts to the end */
} tail;

static tail sum_tail(const vi_bounces *b)
{
    const double t = 2.0 * b->rebound / (b->pressure * (1.0 - b->restitution));
    const double relative = (fabs(b->slope) / b->pressure + fabs(b->drag)) * t;
    const double bend = fabs(b->bend) * t * t / b->pressure, dragged = b->drag * t / 3.0;
    tail sum;
    /* 3.1 to second order in t; for r near 1, where t is long, drag g turns t into ln(1 + g t/3)/(g/3). A motion that
     * grows may have g < 0. */
    sum.duration = (dragged != 0.0 && dragged > -0.5 ? t * (log1p(dragged) / dragged) : t) - t * t / 3.0 * (b->slope / b->pressure);
    sum.error = t * (relative * relative + bend);
    sum.complete = relative + bend < 0.25 && t * b->moving < 0.5;
    return sum;
}

vi_chatter vi_chatter_look(const vi_bounces *b, int64_t low_impacts)
{
    const bool lowest = b->rebound * b->rebound <= 2.0 * b->pressure * LOWEST_BOUNCE * b->resolution;
    const bool loses = b->restitution < 1.0 || b->drag > 0.0;
    const bool endless = low_impacts > MOST_LOW_IMPACTS && (loses || b->tiny);
    if (b->restitution < 1.0) {
        const tail sum = sum_tail(b);
        const double precise = b->fastest > 0.0 ? TAIL_ERROR / b->fastest : HUGE_VAL;
        if (sum.complete && (lowest || endless || sum.error <= precise)) {
            return (vi_chatter){true, true, vi_max(0.0, sum.duration)};
        }
    }
    return (vi_chatter){endless || (lowest && b->restitution == 1.0), false, 0.0};
}
