#include "door/model_exchange_calls.h"

enum { OK = VI_EXCHANGE_OK, WARNING = VI_EXCHANGE_WARNING, ERROR = VI_EXCHANGE_ERROR };

vi_exchange_function vi_exchange_begin_call(const vi_exchange *e, int function)
{
    if (e->noted_call != NULL) {
        *e->noted_call = e->numbers[function];
    }
    return e->calls[function];
}

int vi_exchange_judged(vi_exchange *e, int function, int status)
{
    if (status != OK && status != WARNING) {
        e->function = function;
        e->reason = VI_EXCHANGE_STATUS;
        return status;
    }
    return OK;
}

int vi_exchange_refused(vi_exchange *e, int function, int reason)
{
    e->function = function;
    e->reason = reason;
    return ERROR;
}

int vi_exchange_call(vi_exchange *e, int function)
{
    return vi_exchange_judged(e, function, vi_exchange_begin_call(e, function).plain(e->fmu));
}

int vi_exchange_get_numbers(vi_exchange *e, int function, double numbers[], int64_t count)
{
    if (count == 0) {
        return OK;
    }
    return vi_exchange_judged(e, function,
                              vi_exchange_begin_call(e, function).get_numbers(e->fmu, numbers, (size_t)count));
}

int vi_exchange_set_point(vi_exchange *e, double time, const double states[])
{
    int status = vi_exchange_judged(e, VI_EXCHANGE_SET_TIME,
                                    vi_exchange_begin_call(e, VI_EXCHANGE_SET_TIME).set_time(e->fmu, time));
    if (status == OK && e->state_count > 0) {
        const size_t count = (size_t)e->state_count;
        status = vi_exchange_judged(
            e, VI_EXCHANGE_SET_STATES,
            vi_exchange_begin_call(e, VI_EXCHANGE_SET_STATES).set_numbers(e->fmu, states, count));
    }
    return status;
}

int vi_exchange_read_watched(vi_exchange *e)
{
    const size_t count = (size_t)e->watched_count;
    const vi_exchange_function call = vi_exchange_begin_call(e, VI_EXCHANGE_GET);
    return vi_exchange_judged(e, VI_EXCHANGE_GET,
                              e->version == 3 ? call.get3(e->fmu, e->watched, count, e->values, count)
                                              : call.get2(e->fmu, e->watched, count, e->values));
}

int vi_exchange_move_point(vi_exchange *e, double time)
{
    const int flag = e->cvode->motion(e->solver, time, 0, e->point_vector);
    if (flag != 0) {
        e->solver_flag = flag;
        e->reason = VI_EXCHANGE_SOLVER;
        return ERROR;
    }
    return OK;
}
