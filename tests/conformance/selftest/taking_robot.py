"""A robot that takes everything, for what a mutant sends to it."""

from proof.mutation.messages import Response


def sent_by(change, request):
    """Return the request that a change makes of one."""
    sent = []

    def forward(request):
        sent.append(request)
        return Response(204)

    change(request, forward)
    return sent[0]
