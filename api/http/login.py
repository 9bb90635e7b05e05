"""The login form: the token once, then a cookie that no script can read."""

from urllib.parse import parse_qs

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse, Response

from api.http.guard import COOKIE, Token
from api.http.rendering import page

WEEK_S = 7 * 24 * 3600
router = APIRouter(include_in_schema=False)


@router.get("/login")
def form(request: Request) -> Response:
    """The form, or the first page where no token is needed."""
    return page(request, "login.html", wrong=False) if _token(request) is not None else RedirectResponse("/", 303)


@router.post("/login")
async def login(request: Request) -> Response:
    """The cookie, for the right token."""
    token = _token(request)
    given = parse_qs((await request.body()).decode(errors="replace")).get("token", [""])[0]
    if token is None or not token.is_it(given.strip()):
        return page(request, "login.html", status=401, wrong=True)
    answer = RedirectResponse("/", 303)
    answer.set_cookie(COOKIE, token.session, max_age=WEEK_S, httponly=True, samesite="strict")
    return answer


def _token(request: Request) -> Token | None:
    return request.app.state.token
