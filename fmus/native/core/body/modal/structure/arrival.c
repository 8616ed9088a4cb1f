#include "body/modal/structure/arrival.h"

#include "body/modal/structure/contact.h"
#include "body/modal/structure/impact.h"
#include "body/modal/structure/sensitivity.h"

bool vi_structure_ask(const vi_structure *s, const int hit[], bool stop_here)
{
    bool any = false;
    for (int k = 0; s->model->asks && k < s->model->contacts; ++k) {
        if (!hit[k] || !vi_contact_law_asks(s->contacts[k].law.law)) {
            continue;
        }
        s->contacts[k].event_time = vi_clock_time(&s->model->clock, s->state->now);
        s->contacts[k].answered = 0;
        s->state->asking[k] = stop_here;
        if (!any) {
            *(stop_here ? &s->state->pending : &s->state->passed) = k + 1;
        }
        any = true;
    }
    return any;
}

void vi_structure_resolve_hits(const vi_structure *s, const int hit[])
{
    int rigid[VI_PORTS], any = 0;
    for (int k = 0; k < s->model->contacts; ++k) {
        rigid[k] = 0;
        if (hit[k] && s->model->stop[k] == VI_YIELDING_STOP) {
            vi_structure_touch_down(s, k);
        } else if (hit[k]) {
            rigid[k] = any = 1;
        }
    }
    if (any) {
        vi_structure_collide(s, rigid);
    }
}

void vi_structure_meet(const vi_structure *s, int k, bool stop_here)
{
    int hit[VI_PORTS];
    if (s->sensitive != NULL) {
        vi_sensitivity_meet(s, k);
    }
    vi_structure_put_on_stop(s, k);
    for (int l = 0; l < s->model->contacts; ++l) {
        hit[l] = l == k;
        if (l != k && vi_structure_meets_now(s, l)) {
            s->state->status[l] = VI_CONTACT_TOUCHING;
            s->state->leaving[l] = 0;
            hit[l] = 1;
        }
    }
    if (!vi_structure_ask(s, hit, stop_here)) {
        vi_structure_resolve_hits(s, hit);
    }
}
