#include "door/door.h"

#include <math.h>
#include <string.h>

#include "body/one_mass/body.h"

static bool start(vi_body *body, const vi_door_oscillator *o, double phase, const double state[2])
{
    memset(body, 0, sizeof *body);
    if (!(o->mass > 0.0) || !(o->damping >= 0.0) || !(o->stiffness >= 0.0) || !(o->angular_frequency >= 0.0)
        || !isfinite(o->mass + o->damping + o->stiffness + o->amplitude + phase + state[0] + state[1])) {
        return false;
    }
    body->mass = o->mass;
    vi_mode_start(&body->mode, o->mass, o->damping, o->stiffness, o->amplitude, o->angular_frequency);
    vi_instant now;
    if (!vi_clock_start(&body->clock, o->angular_frequency, phase, body->mode.natural)
        || !vi_clock_instant(&body->clock, 0.0, 0.0, &now)) {
        return false;
    }
    vi_body_start(body, now, state[0], state[1]);
    return true;
}

static bool advance(vi_body *body, double duration)
{
    const vi_step_request request = {0.0, duration, true, false};
    vi_instant target;
    return duration >= 0.0 && vi_clock_instant(&body->clock, duration, 0.0, &target)
           && vi_body_advance(body, target, &request) < VI_STEP_ERROR;
}

VI_DOOR int vi_door_flow(const vi_door_oscillator *oscillator, double phase, const double state[2], double held,
                      double held_rate, double duration, double end[2])
{
    vi_body body;
    if (!start(&body, oscillator, phase, state) || !isfinite(held + held_rate)) {
        return 1;
    }
    vi_body_hold(&body, held, held_rate);
    if (!advance(&body, duration)) {
        return 1;
    }
    end[0] = body.displacement;
    end[1] = body.velocity;
    return 0;
}

VI_DOOR int vi_door_next_contact(const vi_door_oscillator *oscillator, double phase, const double state[2],
                              double position, int side, double duration, double contact[2])
{
    vi_body body;
    if (!start(&body, oscillator, phase, state) || !isfinite(position)) {
        return -1;
    }
    body.contacts[0].law.law = VI_LAW_EXTERNAL; /* stop there, resolve nothing */
    body.contacts[0].side = side;
    body.contacts[0].position = position;
    const vi_instant begin = body.now;
    if (!advance(&body, duration)) {
        return -1;
    }
    if (!body.pending) {
        return 0;
    }
    contact[0] = vi_clock_elapsed(&body.clock, begin, body.now);
    contact[1] = fabs(body.velocity);
    return 1;
}

VI_DOOR int vi_door_motion(const vi_door_oscillator *oscillator, double phase, const double state[2], double position,
                           int side, double restitution, int count, const double instants[], double displacement[],
                           double velocity[])
{
    vi_body body;
    if (!start(&body, oscillator, phase, state) || !isfinite(position) || !(restitution >= 0.0 && restitution <= 1.0)) {
        return -1;
    }
    body.contacts[0].law.law = side == 0 ? VI_LAW_NONE : VI_LAW_RESTITUTION;
    body.contacts[0].law.restitution = restitution;
    body.contacts[0].side = side == 0 ? 1 : side;
    body.contacts[0].position = position;
    double reached = 0.0;
    for (int i = 0; i < count; ++i) {
        const vi_step_request request = {reached, instants[i] - reached, false, false};
        vi_instant target;
        if (!(instants[i] >= reached) || !vi_clock_instant(&body.clock, instants[i], 0.0, &target)
            || vi_body_advance(&body, target, &request) >= VI_STEP_ERROR) {
            return -1;
        }
        reached = instants[i];
        displacement[i] = body.displacement;
        velocity[i] = body.velocity;
    }
    return (int)body.contacts[0].count;
}
