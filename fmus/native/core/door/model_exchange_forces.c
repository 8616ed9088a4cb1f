#include "door/model_exchange_forces.h"

#include <math.h>

enum { OK = VI_EXCHANGE_OK, ERROR = VI_EXCHANGE_ERROR };

/* Gauss points and weights of [0, 1]. */
enum { POINTS = 4 };
static const double POINT[POINTS] = {0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970262};
static const double WEIGHT[POINTS] = {0.17392742256872693, 0.32607257743127305, 0.32607257743127305,
                                      0.17392742256872693};

double vi_exchange_stop_force(const vi_exchange *e, const vi_exchange_watch *watch)
{
    const double depth = -(watch->factor * e->values[watch->value] + watch->offset);
    const double rate = -watch->factor * e->values[watch->rate];
    const vi_law *law = vi_law_of(watch->law.law);
    const vi_press press = vi_law_press(law, &watch->law);
    if (press.kind == VI_PRESS_LINEAR || depth > 0.0) {
        return law->force(&press, depth, rate).force;
    }
    return depth < 0.0 ? -law->force(&press, -depth, rate).force : 0.0; /* as smooth beyond the surface */
}

static bool presses(const vi_exchange *e)
{
    bool found = false;
    for (int64_t k = 0; k < e->watch_count; k++) {
        found = found || e->watches[k].is_pressed;
    }
    return found;
}

bool vi_exchange_has_forces(const vi_exchange *e)
{
    return e->gives_forces || presses(e);
}

int vi_exchange_give_forces(vi_exchange *e)
{
    const size_t count = (size_t)e->force_count;
    for (size_t i = 0; i < count; i++) {
        e->given[i] = 0.0;
    }
    int status = vi_exchange_read_watched(e);
    for (int64_t k = 0; status == OK && k < e->watch_count; k++) {
        const vi_exchange_watch *watch = &e->watches[k];
        if (watch->is_pressed) {
            e->given[watch->force] += watch->factor * vi_exchange_stop_force(e, watch);
        }
    }
    if (status != OK) {
        return status;
    }
    const vi_exchange_function call = vi_exchange_begin_call(e, VI_EXCHANGE_SET_FORCES);
    e->gives_forces = presses(e);
    return vi_exchange_judged(e, VI_EXCHANGE_SET_FORCES,
                              e->version == 3 ? call.put3(e->fmu, e->forces, count, e->given, count)
                                              : call.put2(e->fmu, e->forces, count, e->given));
}

int vi_door_exchange_show(vi_exchange *e, double time, const double states[])
{
    const int status = vi_exchange_set_point(e, time, states);
    return status == OK && vi_exchange_has_forces(e) ? vi_exchange_give_forces(e) : status;
}

int vi_exchange_add_impulses(vi_exchange *e, double before)
{
    if (!presses(e)) {
        return OK;
    }
    const double size = e->time - before;
    for (int i = 0; i < POINTS; i++) {
        const double time = before + POINT[i] * size;
        int status = vi_exchange_move_point(e, time);
        status = status != OK ? status : vi_exchange_set_point(e, time, e->point);
        status = status != OK ? status : vi_exchange_read_watched(e);
        if (status != OK) {
            return status;
        }
        for (int64_t k = 0; k < e->watch_count; k++) {
            vi_exchange_watch *watch = &e->watches[k];
            if (watch->is_pressed) {
                const double force = fmax(0.0, vi_exchange_stop_force(e, watch));
                watch->impulse += WEIGHT[i] * size * force;
                watch->largest = fmax(watch->largest, force);
            }
        }
    }
    return OK;
}
